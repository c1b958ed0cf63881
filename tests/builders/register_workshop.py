"""Simulated Modbus registers on sockets and serial ports, and a replacement for the driver's
pause.
"""

from __future__ import annotations

import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import serial
from pymodbus.client import ModbusSerialClient

from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusRtu, ModbusTcp, ModbusTls, MonitorConfig
from config.load import load_bundled_or_path
from config.simulation.faults import RegisterFault
from drivers.modbus.codec import encode
from drivers.modbus.link import ModbusLink
from mock_hw.registers.registers import SimulatedRegisters
from mock_hw.registers.server import RegisterService, RegisterSettings, ServerCertificates

PROFILE = load_bundled_or_path("servo_registers", "profiles", DriveProfile)
UNITS = (1, 2, 9)
PATIENCE_S = 10.0  # timeout for an answer that arrives, even on a busy computer
TIMEOUT_S = 4.0  # timeout for answers that may never arrive


def registers(unit: int) -> dict[int, int] | None:
    """Return the registers of one of three drives at 20, 30 and 100 °C; None for other units."""
    if unit not in UNITS:
        return None
    return encode(
        PROFILE,
        {
            "motor_temperature_k": 283.15 + 10.0 * unit,
            "operating_time_s": 7200.0 + unit,
            "torque_constant_nm_per_a": 0.9,
            "torque_constant_per_k": -0.001,
            "reference_temperature_k": 298.15,
            "rated_torque_nm": 4.6,
            "rated_current_a": 5.111,
            "rotor_inertia_kg_m2": 0.0015,
        },
    )


def at_first(kind: Any, **more: Any) -> RegisterFault:
    return RegisterFault(kind=kind, at_request=0, **more)


class Workshop:
    """Starter of register services; the exit stack ends them."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self._path = path
        self._stack = stack
        self.service: RegisterService | None = None
        self.link: ModbusLink | None = None
        self.late = False
        self.drives: SimulatedRegisters | None = None

    def serve(
        self,
        kind: str,
        *,
        fault: RegisterFault | None = None,
        tls: ModbusTls | None = None,
        certificates: ServerCertificates | None = None,
    ) -> MonitorConfig:
        link: Any = ModbusTcp(kind="tcp", host="127.0.0.1", port=0, tls=tls)
        if kind == "rtu":
            link = ModbusRtu(kind="rtu", address=str(self._path / "line"), parity="none")
        timeout_s = PATIENCE_S if fault is None else TIMEOUT_S
        config = MonitorConfig(link=link, units=UNITS, timeout_s=timeout_s)
        settings = RegisterSettings(config, PROFILE, self._path / "line", certificates)
        self.drives = SimulatedRegisters(registers, [fault] if fault else [])
        self.service = self._stack.enter_context(
            RegisterService(self.drives, settings, realtime=False)
        )
        if kind == "tcp":
            link = link.model_copy(update={"port": self.service.port})
        return config.model_copy(update={"link": link})

    @property
    def requests(self) -> int:
        assert self.drives is not None
        return self.drives.requests

    def pause(self, duration_s: float) -> None:
        """Replace the driver's pause: wait for a late answer, if one is expected."""
        assert self.service is not None
        if not self.late:
            time.sleep(duration_s)
            return
        self.late = False
        self.service.send_late_answers()
        client = self.link._client if self.link is not None else None
        if not isinstance(client, ModbusSerialClient):
            return
        port = client.socket
        if isinstance(
            port, serial.Serial
        ):  # a pseudo-terminal passes bytes on with an unknown delay
            give_up_s = time.monotonic() + 120.0
            while not port.in_waiting and time.monotonic() < give_up_s:
                os.sched_yield()
