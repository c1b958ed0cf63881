"""`AmplifierPort`: the amplifier of a simulated force plate, its line and its serial port.

In real time, the port delivers bytes to the computer at their arrival time. In lock-step it
delivers them immediately, and writes the simulated arrival times of the rows into a file
(`drivers.amplifier.simulated_arrivals`).
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.simulation.faults import AmplifierFault
from drivers.amplifier.simulated_arrivals import ArrivalWriter, arrivals_path
from mock_hw.amplifier.amplifier import SimulatedAmplifier
from mock_hw.amplifier.line_faults import FaultInjector, Unit
from mock_hw.amplifier.rows import RowBlock
from mock_hw.amplifier.sensors import PlateSensors
from mock_hw.amplifier.serial_line import BITS_PER_BYTE, SerialLine
from mock_hw.amplifier.settings import PlateSettings
from mock_hw.host.pty_port import UNKNOWN_RATE, PtyPort

BUFFER_BYTES = 16384
"""Size of the amplifier's send buffer [bytes], which fills if the line is too slow for the rows."""

_BUNCH_S = 0.001
_NANOSECONDS = 9  # decimals; rounding removes effects of the order of additions
_TWICE = 2.0


class AmplifierPort:
    """Amplifier, line and port of a plate, as one `SimulatedDevice`; the caller applies the loads.

    Args:
        settings: Settings of the plate.
        realtime: True for arrival times on the computer's clock; False for simulated time.
        now_s: Switch-on time of the amplifier [s].

    Attributes:
        next_s: Time at which `advance` is due [s], because bytes arrive or the port is plugged in
            again; infinity if nothing is due.

    Raises:
        TransportError: The port cannot be created.
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
        """True if the amplifier measures, so that it needs the loads on its sensors."""
        return self._device.physics.operating

    @property
    def works(self) -> bool:
        """True if the amplifier measures, produces rows, or has bytes to deliver."""
        physics = self._device.physics
        return physics.operating or physics.converting or self.next_s < math.inf

    @property
    def passed_bytes(self) -> int:
        """Number of bytes that the port has delivered to a computer."""
        return self._port.passed_bytes

    @property
    def time_s(self) -> float:
        """Time up to which loads have been applied to the plate [s]."""
        return self._device.physics.time_s

    def fileno(self) -> int:
        """Return the file descriptor that commands make readable; -1 while unplugged."""
        return self._port.fileno()

    def read(self) -> bytes:
        """Return the bytes received from the computer; random bytes if the baud rates differ."""
        data = b""
        while more := self._port.read():
            data += more
        return data if self._baud_rates_match() else self._faults.noise(len(data))

    def receive(
        self, data: bytes, base_wrench: NDArray[np.float64], now_s: float | None = None
    ) -> None:
        """Execute received commands.

        Args:
            data: Bytes returned by `read`.
            base_wrench: Shape (6,). Present wrench of the base on the robot [N, N m].
            now_s: Present time [s]; None for the time up to which the amplifier has been advanced.
        """
        self._device.receive(data, lambda: self._sensors.charges_pc(base_wrench), now_s)
        self._send()
        self.advance(self.time_s if now_s is None else now_s)

    def apply_loads(
        self,
        end_s: float,
        ends_s: ArrayLike = (),
        base_wrenches: ArrayLike = (),
        edges_s: ArrayLike = (),
    ) -> None:
        """Apply the loads on the plate until `end_s`, and send the measured rows.

        Args:
            end_s: End time [s].
            ends_s: Shape (m,). Ends of intervals [s].
            base_wrenches: Shape (m, 6). Wrench of the base on the robot in each interval.
            edges_s: Shape (edges,). Times of the SYNC frames, which cause edges at the trigger
                input [s].
        """
        ends = np.asarray(ends_s, dtype=np.float64)
        charges = self._sensors.charges_pc(np.reshape(base_wrenches, (-1, 6)))
        self._device.apply_loads(end_s, ends, self._with_lasting_faults(ends, charges), edges_s)
        self._send()
        self.advance(end_s)

    def advance(self, until_s: float) -> None:
        """Deliver the bytes that have arrived by `until_s` [s]; plug the port in again when due."""
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
        """Return True if the buffer has room for rows; in this case report previously lost rows."""
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
        if self._faults.affects(count):
            for place in range(count):
                data = rows.data[place * rows.size : (place + 1) * rows.size]
                row = Unit(data, float(rows.ready_s[place]), int(rows.sequence[place]))
                units, lasting = self._faults.apply_faults(row)
                for fault in lasting:
                    self._begin(fault, row.ready_s)
                for unit in units:
                    self._send_unit(unit)
            return
        self._faults.skip_rows(count)
        arrived = self._line.send(rows.ready_s, np.full(count, rows.size))
        if self._arrivals is not None:
            self._arrivals.write(rows.sequence, np.round(arrived, _NANOSECONDS))
            self._write(rows.data)
        else:
            self._hold(rows, arrived)

    def _send_unit(self, unit: Unit) -> None:
        if self._arrivals is not None and self._device.physics.converting and unit.sequence < 0:
            # An answer depends on wall-clock time, so it must not change the arrival times of rows.
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
        """Store rows until their arrival time; those within a millisecond form one piece."""
        first = 0
        while first < len(arrived):
            last = int(np.searchsorted(arrived, arrived[first] + _BUNCH_S, side="right"))
            data = rows.data[first * rows.size : last * rows.size]
            self._held.append((float(arrived[last - 1]), data))
            first = last

    def _write(self, data: bytes) -> None:
        if not self._baud_rates_match():
            data = self._faults.noise(len(data))
        self._port.write(data)

    def _baud_rates_match(self) -> bool:
        """Return True if computer and amplifier have the same baud rate."""
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
        elif fault.kind == "reset":
            self._device.physics.reset()
        elif fault.kind == "drift":
            self._drifts.append((now_s, fault))

    def _with_lasting_faults(
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
