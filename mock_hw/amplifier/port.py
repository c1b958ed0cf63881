"""`AmplifierPort`: a simulated force plate's amplifier at a serial port, with the line in between.

In real time bytes are held back until they have arrived. In lock-step they are handed over at
once, with the simulated time of their arrival beside them (`drivers.amplifier.simulated_arrivals`).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import PlateConfig
from config.simulation.faults import NO_SCRIPT, AmplifierFault, FaultScript
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.simulated_arrivals import ArrivalWriter, arrivals_path
from mock_hw.amplifier.amplifier import SimulatedAmplifier
from mock_hw.amplifier.line_faults import FaultInjector, Unit
from mock_hw.amplifier.rows import RowBlock
from mock_hw.amplifier.sensors import PlateSensors
from mock_hw.amplifier.serial_line import BITS_PER_BYTE, SerialLine
from mock_hw.host.pty_port import UNKNOWN_RATE, PtyPort

BUFFER_BYTES = 16384
"""What the amplifier can hold back for a line that is slower than its rows."""

_BUNCH_S = 0.001
_NANOSECONDS = 9  # decimals: sums in another order shall not change what a run gives
_TWICE = 2.0


@dataclass(frozen=True)
class PlateSettings:
    """What is served: the cell's plate, its profile and truth, and what goes wrong.

    Attributes:
        plate, profile, truth: The plate as the cell file has it, the strings of its amplifier, and
            what it really does.
        path: Where the port is to be.
        seed: Of noise and jitter.
        baud_rate: What the amplifier is set to, where that is not what the cell file says.
        faults: What goes wrong; its `amplifier` part is used.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    truth: SimulatedPlate
    path: Path
    seed: int = 0
    baud_rate: int | None = None
    faults: FaultScript = NO_SCRIPT


class AmplifierPort:
    """The amplifier, its line and its port: a `SimulatedDevice` that is told what its sensors feel.

    Args:
        settings: What is served.
        realtime: Whether bytes arrive on the computer's own clock; simulated time otherwise.
        now_s: When the amplifier is switched on [s].

    Attributes:
        next_s: When `advance` is due: bytes arrive, or the port comes back [s]; infinity for never.

    Raises:
        TransportError: The port cannot be made.
    """

    def __init__(self, settings: PlateSettings, *, realtime: bool, now_s: float = 0.0) -> None:
        amplifier = settings.plate.amplifier
        self._baud_rate = settings.baud_rate or amplifier.baud_rate
        self._sensors = PlateSensors(settings.plate, settings.truth)
        self._device = SimulatedAmplifier(
            settings.profile,
            settings.truth,
            settings.seed,
            now_s,
            bits=amplifier.bits,
            low_pass_order=amplifier.low_pass_order,
        )
        self._line = SerialLine(self._baud_rate, settings.truth.line_jitter_s, settings.seed + 1)
        self._faults = FaultInjector(settings.faults.amplifier, settings.faults.seed)
        self._overloads: list[tuple[float, int]] = []
        self._drifts: list[tuple[float, AmplifierFault]] = []
        self._replug_s = math.inf
        self._lost_rows = 0
        self._held: deque[tuple[float, bytes]] = deque()
        self._realtime = realtime
        self._arrivals_path = arrivals_path(str(settings.path))
        self._port = PtyPort(settings.path, patient=not realtime)
        self._arrivals = None if realtime else ArrivalWriter(self._arrivals_path)
        self.next_s = math.inf

    @property
    def watches(self) -> bool:
        """Whether the amplifier cares for what the sensors feel: it operates."""
        return self._device.physics.operating

    @property
    def works(self) -> bool:
        """Whether time matters to it: it operates, makes rows, or still has some to hand over."""
        physics = self._device.physics
        return physics.operating or physics.converting or self.next_s < math.inf

    @property
    def passed_bytes(self) -> int:
        """How many bytes a listening computer was given."""
        return self._port.passed_bytes

    @property
    def time_s(self) -> float:
        """Until when it has been told what acts on the plate [s]."""
        return self._device.physics.time_s

    def fileno(self) -> int:
        """Return the descriptor that is readable when a command has come; -1 while unplugged."""
        return self._port.fileno()

    def read(self) -> bytes:
        """Return what has come from the computer."""
        data = b""
        while more := self._port.read():
            data += more
        return data if self._understood() else self._faults.noise(len(data))

    def receive(
        self, data: bytes, base_wrench: NDArray[np.float64], now_s: float | None = None
    ) -> None:
        """Do what has been commanded.

        Args:
            data: What `read` has returned.
            base_wrench: Shape (6,). What the base exerts on the robot now.
            now_s: What time it is, where that is later than the amplifier has been brought [s].
        """
        self._device.receive(data, lambda: self._sensors.charges_pc(base_wrench), now_s)
        self._send()
        self.advance(self.time_s if now_s is None else now_s)

    def feel(
        self,
        end_s: float,
        ends_s: ArrayLike = (),
        base_wrenches: ArrayLike = (),
        edges_s: ArrayLike = (),
    ) -> None:
        """Take what acts on the plate until `end_s`, and send what is measured meanwhile.

        Args:
            end_s: Until when [s].
            ends_s, base_wrenches: Shape (m,), (m, 6). Ends of intervals [s], and what the base
                exerted on the robot in each.
            edges_s: Shape (edges,). When SYNC was there, at the trigger input [s].
        """
        ends = np.asarray(ends_s, dtype=np.float64)
        charges = self._sensors.charges_pc(np.reshape(base_wrenches, (-1, 6)))
        self._device.feel(end_s, ends, self._spoilt(ends, charges), edges_s)
        self._send()
        self.advance(end_s)

    def advance(self, until_s: float) -> None:
        """Hand over what has arrived by `until_s` [s]; plug the port in again when it is time."""
        if until_s >= self._replug_s:
            self._replug_s = math.inf
            self._port.plug()
        held = self._held
        ready = []
        while held and held[0][0] <= until_s:
            ready.append(held.popleft()[1])
        if ready:
            self._write(b"".join(ready))
        self.next_s = min(held[0][0] + _BUNCH_S if held else math.inf, self._replug_s)

    def close(self) -> None:
        """Remove the port."""
        self._port.close()
        self._arrivals_path.unlink(missing_ok=True)

    # The line

    def _send(self) -> None:
        for piece in self._device.take():
            if isinstance(piece, Unit):
                self._send_unit(piece)
            elif self._has_room(piece):
                self._send_rows(piece)

    def _has_room(self, rows: RowBlock) -> bool:
        """Return whether the amplifier's buffer takes rows; report the lost when it does again."""
        backlog_s = self._line.free_s - float(rows.ready_s[0])
        if backlog_s * self._baud_rate / BITS_PER_BYTE > BUFFER_BYTES:
            self._lost_rows += len(rows.ready_s)
            return False
        if self._lost_rows:
            self._device.overrun(self._lost_rows)
            self._lost_rows = 0
        return True

    def _send_rows(self, rows: RowBlock) -> None:
        count = len(rows.ready_s)
        if self._faults.touches(count):
            for place in range(count):
                data = rows.data[place * rows.size : (place + 1) * rows.size]
                row = Unit(data, float(rows.ready_s[place]), int(rows.sequence[place]))
                units, lasting = self._faults.spoil(row)
                for fault in lasting:
                    self._begin(fault, row.ready_s)
                for unit in units:
                    self._send_unit(unit)
            return
        self._faults.passes(count)
        arrived = self._line.send(rows.ready_s, np.full(count, rows.size))
        if self._arrivals is not None:
            self._arrivals.write(rows.sequence, np.round(arrived, _NANOSECONDS))
            self._write(rows.data)
        else:
            self._hold(rows, arrived)

    def _send_unit(self, unit: Unit) -> None:
        if self._arrivals is not None and self._device.physics.converting and unit.sequence < 0:
            # An answer to somebody who asks by the wall clock must not move the rows' arrivals.
            self._write(unit.data)
            return
        (arrived_s,) = self._line.send([unit.ready_s], [len(unit.data)]).tolist()
        if self._arrivals is None:
            self._held.append((arrived_s, unit.data))
            return
        if unit.sequence >= 0:
            self._arrivals.write(unit.sequence, round(arrived_s, _NANOSECONDS))
        self._write(unit.data)

    def _hold(self, rows: RowBlock, arrived: NDArray[np.float64]) -> None:
        """Hold rows until they have arrived, those of a millisecond together."""
        first = 0
        while first < len(arrived):
            last = int(np.searchsorted(arrived, arrived[first] + _BUNCH_S, side="right"))
            data = rows.data[first * rows.size : last * rows.size]
            self._held.append((float(arrived[last - 1]), data))
            first = last

    def _write(self, data: bytes) -> None:
        if not self._understood():
            data = self._faults.noise(len(data))
        self._port.write(data)

    def _understood(self) -> bool:
        """Return whether the computer's baud rate is the amplifier's."""
        return self._port.baud_rate in (self._baud_rate, UNKNOWN_RATE)

    # Faults that last

    def _begin(self, fault: AmplifierFault, now_s: float) -> None:
        until_s = now_s + fault.duration_s
        if fault.kind == "stall":
            self._line.stall(until_s)
        elif fault.kind == "unplug":
            self._port.unplug()
            self._replug_s = until_s
        elif fault.kind == "overload":
            self._overloads.append((until_s, fault.channel))
        elif fault.kind == "drift":
            self._drifts.append((now_s, fault))

    def _spoilt(
        self, ends_s: NDArray[np.float64], charges: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        settings = self._device.physics.settings
        for until_s, channel in self._overloads:
            extra = _TWICE * settings.range_n[channel] * settings.sensitivity_pc_n[channel]
            charges[:, channel] += np.where(ends_s <= until_s, extra, 0.0)
        self._overloads = [item for item in self._overloads if item[0] > self.time_s]
        for begin_s, drift in self._drifts:
            extra = drift.count * settings.sensitivity_pc_n[drift.channel]
            charges[:, drift.channel] += extra * np.clip(ends_s - begin_s, 0.0, drift.duration_s)
        return charges
