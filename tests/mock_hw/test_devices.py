"""Every simulated device keeps the rules of simulated time: `next_s` and `advance`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusRtu, MonitorConfig
from config.load import LoadedCell, load_bundled_or_path, load_cell
from config.simulation.faults import DriveFault, FaultScript
from mock_hw.amplifier.port import AmplifierPort
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_process import listening_socket
from mock_hw.host.device import SimulatedDevice
from mock_hw.rack import DriveRack
from mock_hw.registers.registers import SimulatedRegisters
from mock_hw.registers.server import RegisterService, RegisterSettings
from mock_hw.simulation import CellSimulation

Make = Callable[[LoadedCell, Path, ExitStack], SimulatedDevice]


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def rack(loaded: LoadedCell, folder: Path, stack: ExitStack) -> DriveRack:
    assert loaded.plant is not None
    script = FaultScript(drives=(DriveFault(kind="reset", at_s=0.013),))
    return DriveRack(loaded.config, loaded.robot, loaded.plant, 1, faults=script)


def drive(loaded: LoadedCell, folder: Path, stack: ExitStack) -> SimulatedDevice:
    return rack(loaded, folder, stack).drives[0]


def amplifier(loaded: LoadedCell, folder: Path, stack: ExitStack) -> AmplifierPort:
    assert loaded.plant is not None
    simulation = CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=True, seed=1)
    settings = simulation.plate(folder / "plate")
    assert settings is not None
    port = AmplifierPort(settings, realtime=True)
    stack.callback(port.close)
    port.receive(b"SF1\rRO1\rST1\r", np.zeros(6))
    port.apply_loads(0.005)
    return port


def registers(loaded: LoadedCell, folder: Path, stack: ExitStack) -> RegisterService:
    link = ModbusRtu(kind="rtu", address=str(folder / "line"), parity="none")
    profile = load_bundled_or_path("servo_registers", "profiles", DriveProfile)
    settings = RegisterSettings(MonitorConfig(link=link, units=(1,)), profile, folder / "line")
    drives = SimulatedRegisters(lambda unit: {100: unit})
    return stack.enter_context(RegisterService(drives, settings, realtime=True))


def hub(loaded: LoadedCell, folder: Path, stack: ExitStack) -> CanHub:
    listener = stack.enter_context(listening_socket(folder / "hub.sock"))
    hub = CanHub(listener, 1_000_000, realtime=True)
    stack.callback(hub.close)
    return hub


@pytest.fixture(params=[rack, drive, amplifier, registers, hub], ids=lambda make: make.__name__)
def device(
    request: pytest.FixtureRequest, loaded: LoadedCell, tmp_path: Path
) -> Iterator[SimulatedDevice]:
    with ExitStack() as stack:
        yield request.param(loaded, tmp_path, stack)


def test_after_any_step_the_next_event_is_in_the_future(device: SimulatedDevice) -> None:
    begin_s = time.monotonic() if isinstance(device, CanHub | RegisterService) else 0.0
    for step in (0.001, 0.0191, 0.0192, 0.03, 0.1):
        device.advance(begin_s + step)
        assert device.next_s > begin_s + step


def test_a_drive_boots_at_its_announced_time(loaded: LoadedCell, tmp_path: Path) -> None:
    booting = rack(loaded, tmp_path, ExitStack()).drives[0]
    booting.advance(0.5 * booting.next_s)
    assert booting.take_frames() == []
    booting.advance(booting.next_s)
    assert [frame.cob_id for _, frame in booting.take_frames()] == [0x700 + booting.node_id]
