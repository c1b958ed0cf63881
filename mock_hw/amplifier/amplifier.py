"""`SimulatedAmplifier`: a charge amplifier that answers commands and streams rows, as bytes.

Its state depends only on its profile, its simulated physics, and the bytes and times that the
caller passes; it has no port and reads no clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import CHANNELS
from config.simulation.plant import SimulatedPlate
from drivers.amplifier.codec import (
    NO_SUCH_CHANNEL,
    AmplifierCodec,
    AmplifierCommand,
    AmplifierReply,
    LineSplitter,
    RequestError,
)
from drivers.amplifier.frames import encode_event, event_layout
from mock_hw.amplifier.analog import AmplifierRows, ChargeAmplifier
from mock_hw.amplifier.line_faults import Unit
from mock_hw.amplifier.rows import RowBlock, row_encoder

IDENTITY = "rid-daq,simulated 8-channel charge amplifier,0001,1.0"

NOT_UNDERSTOOD = "02"
OUT_OF_RANGE = "03"
NOT_WHILE_STREAMING = "05"
ONLY_ASKED = "06"

_LIMITS = {
    "range": (1.0, 100_000.0),
    "sensitivity": (-1000.0, 1000.0),
    "low_pass": (1.0, 30_000.0),
    "rate": (1.0, 10_000.0),
}
_PER_CHANNEL = ("range", "sensitivity")
_FORMS = ("ascii", "binary")

Outgoing = Unit | RowBlock
Charges = Callable[[], NDArray[np.float64]]


class SimulatedAmplifier:
    """A charge amplifier at the end of a serial line.

    While it streams rows, it accepts only the end of the stream, the query of the time and the
    query of the overload word (and ignores a second start). It answers the two queries by events in
    the stream. At all other times it accepts every valid command.

    Args:
        profile: Words of the commands, and formats of rows and events.
        truth: True physical properties of the simulated plate.
        seed: Random seed of the noise.
        now_s: Switch-on time [s].
        bits: Resolution of the converter [bit].
        low_pass_order: Order of the low-pass filter.

    Attributes:
        physics: The simulated charge amplifiers, filters and converter.
    """

    def __init__(
        self,
        profile: AmplifierProfile,
        truth: SimulatedPlate,
        seed: int,
        now_s: float = 0.0,
        *,
        bits: int = 16,
        low_pass_order: int = 2,
    ) -> None:
        self._profile = profile
        self._codec = AmplifierCodec(profile)
        self._lines = LineSplitter()
        self.physics = ChargeAmplifier(truth, seed, now_s)
        built = replace(self.physics.settings, bits=bits, low_pass_order=low_pass_order)
        self.physics.apply(built)
        self._form = "ascii"
        self._encode_rows = row_encoder(profile, "ascii")
        self._event = event_layout(profile, "ascii")
        self._trigger = False
        self._edges = 0
        self._marks = 0
        self._sequence = 0
        self._reported = 0
        self._overrun = False
        self._out: list[Outgoing] = []
        self._commands: dict[str, Callable[[AmplifierCommand, Charges], AmplifierReply]] = {
            "operate": self._operate,
            "range": self._set,
            "sensitivity": self._set,
            "low_pass": self._set,
            "rate": self._set,
            "format": self._set_format,
            "trigger": self._set_trigger,
            "stream": self._stream,
        }
        self._queries: dict[str, Callable[[], str]] = {
            "operate": lambda: str(int(self.physics.operating)),
            "identify": lambda: IDENTITY,
            "overload": lambda: f"{self.physics.take_overload():02X}",
            "values": self._values,
            "bits": lambda: str(self.physics.settings.bits),
            "low_pass": lambda: f"{self.physics.settings.low_pass_hz:g}",
            "rate": lambda: f"{self.physics.settings.rate_hz:g}",
            "format": lambda: str(_FORMS.index(self._form)),
            "trigger": lambda: str(int(self._trigger)),
            "stream": lambda: str(int(self.physics.converting)),
            "time": lambda: f"{self._ticks(self.physics.time_s) & 0xFFFF_FFFF:08X}",
        }

    def receive(self, data: bytes, charges: Charges, now_s: float | None = None) -> None:
        """Process bytes that were received from the computer.

        Args:
            data: The bytes.
            charges: Function that returns the present charges of the sensors, (8,) [pC]; called
                when the measurement starts or restarts.
            now_s: Present time [s], at which answers are sent and the amplifier's clock is read;
                None for the time up to which the physics has been advanced.
        """
        now_s = self.physics.time_s if now_s is None else max(now_s, self.physics.time_s)
        self._lines.feed(data.replace(b"\0", b""))
        while (line := self._lines.next_line()) is not None:
            answer = self._answer(line, charges, now_s)
            if answer is not None:
                self._out.append(Unit(self._codec.answer(answer), now_s))

    def apply_loads(
        self,
        end_s: float,
        ends_s: ArrayLike = (),
        charges_pc: ArrayLike = (),
        edges_s: ArrayLike = (),
    ) -> None:
        """Advance time with the arguments of `ChargeAmplifier.convert`; create rows and events.

        Args:
            edges_s: Times of edges at the trigger input [s].
        """
        rows = self.physics.convert(end_s, ends_s, charges_pc)
        if not self.physics.converting:
            return
        first = 0
        for time_s, event, detail in self._new_events(rows, np.asarray(edges_s, dtype=np.float64)):
            last = int(np.searchsorted(rows.time_s, time_s))
            self._put_rows(rows, first, last)
            first = max(first, last)
            self._put_event(event, detail, time_s, time_s)
        self._put_rows(rows, first, len(rows.time_s))

    def take(self) -> list[Outgoing]:
        """Return the pieces of bytes to send, in order, and clear the list."""
        out, self._out = self._out, []
        return out

    def overrun(self, rows: int) -> None:
        """Report, by an event and in all later rows of the stream, that rows were lost."""
        self._overrun = True
        self._put_event("overrun", rows, self.physics.time_s, self.physics.time_s)

    # Answers

    def _answer(self, line: bytes, charges: Charges, now_s: float) -> AmplifierReply | None:
        try:
            request = self._codec.read_request(line)
        except RequestError as error:
            return AmplifierReply(error=error.number)
        if self.physics.converting:
            return self._while_streaming(request, now_s)
        if request.channel and request.name not in _PER_CHANNEL:
            return AmplifierReply(error=NO_SUCH_CHANNEL)
        if request.value is None:
            if request.name in _PER_CHANNEL:
                return AmplifierReply(self._per_channel(request))
            if request.name == "time":
                return AmplifierReply(f"{self._ticks(now_s) & 0xFFFF_FFFF:08X}")
            return AmplifierReply(self._queries[request.name]())
        if request.name not in self._commands:
            return AmplifierReply(error=ONLY_ASKED)
        return self._commands[request.name](request, charges)

    def _while_streaming(self, request: AmplifierCommand, now_s: float) -> AmplifierReply | None:
        """Answer the two queries by events; besides them, accept only the end of the stream."""
        asked = request.value is None
        if asked and request.name == "time":
            self._put_event("mark", self._marks, now_s, now_s)
            self._marks += 1
            return None
        if asked and request.name == "overload":
            self._put_event("overload", self.physics.take_overload(), now_s, now_s)
            self._reported = 0
            return None
        if request.name == "stream" and request.value in ("0", "1"):
            return self._stream(request, _no_charges)
        return AmplifierReply(error=NOT_WHILE_STREAMING)

    def _operate(self, request: AmplifierCommand, charges: Charges) -> AmplifierReply:
        if request.value not in ("0", "1"):
            return AmplifierReply(error=NOT_UNDERSTOOD)
        if request.value == "1":
            self.physics.operate(charges())
        else:
            self.physics.reset()
        return AmplifierReply()

    def _per_channel(self, request: AmplifierCommand) -> str:
        settings = self.physics.settings
        values = settings.range_n if request.name == "range" else settings.sensitivity_pc_n
        asked = values if not request.channel else values[request.channel - 1 : request.channel]
        return ",".join(f"{value:g}" for value in asked)

    def _set(self, request: AmplifierCommand, charges: Charges) -> AmplifierReply:
        value = _number(request.value)
        if value is None:
            return AmplifierReply(error=NOT_UNDERSTOOD)
        lowest, highest = _LIMITS[request.name]
        if not lowest <= value <= highest or value == 0.0:
            return AmplifierReply(error=OUT_OF_RANGE)
        physics, settings = self.physics, self.physics.settings
        if request.name == "low_pass":
            physics.apply(replace(settings, low_pass_hz=value))
            return AmplifierReply()
        if request.name == "rate":
            physics.apply(replace(settings, rate_hz=value))
            return AmplifierReply()
        which = range(CHANNELS) if not request.channel else (request.channel - 1,)
        ranges, sensitivities = list(settings.range_n), list(settings.sensitivity_pc_n)
        for channel in which:
            (ranges if request.name == "range" else sensitivities)[channel] = value
        changed = replace(settings, range_n=tuple(ranges), sensitivity_pc_n=tuple(sensitivities))
        physics.apply(changed)
        if changed == settings or not physics.operating:
            return AmplifierReply()
        physics.reset()
        physics.operate(charges())
        return AmplifierReply(charge_lost=True)

    def _set_format(self, request: AmplifierCommand, charges: Charges) -> AmplifierReply:
        del charges
        if request.value not in ("0", "1"):
            return AmplifierReply(error=NOT_UNDERSTOOD)
        self._form = _FORMS[int(request.value)]
        self._encode_rows = row_encoder(self._profile, self._form)
        self._event = event_layout(self._profile, self._form)
        return AmplifierReply()

    def _set_trigger(self, request: AmplifierCommand, charges: Charges) -> AmplifierReply:
        del charges
        if request.value not in ("0", "1"):
            return AmplifierReply(error=NOT_UNDERSTOOD)
        self._trigger = request.value == "1"
        return AmplifierReply()

    def _stream(self, request: AmplifierCommand, charges: Charges) -> AmplifierReply:
        del charges
        if request.value not in ("0", "1"):
            return AmplifierReply(error=NOT_UNDERSTOOD)
        if request.value == "1" and not self.physics.converting:
            self._sequence = self._edges = self._marks = 0
            self._reported = self.physics.overload
            self._overrun = False
            self.physics.start()
        elif request.value == "0" and self.physics.converting:
            now_s = self.physics.time_s
            self._put_event("stopped", 0, now_s, now_s)
            self.physics.stop()
        return AmplifierReply()

    def _values(self) -> str:
        settings = self.physics.settings
        newtons = self.physics.present_counts() * np.array(settings.range_n)
        return ",".join(f"{value:.3f}" for value in newtons / 2 ** (settings.bits - 1))

    # The stream

    def _new_events(
        self, rows: AmplifierRows, edges_s: NDArray[np.float64]
    ) -> list[tuple[float, str, int]]:
        """Return time, name and detail of the events between the rows, in order."""
        events: list[tuple[float, str, int]] = []
        if self._trigger:
            for time_s in edges_s.tolist():
                events.append((time_s, "trigger", self._edges))
                self._edges += 1
        if len(rows.overload) and (self.physics.overload & ~self._reported):
            known = self._reported
            for place, word in enumerate(rows.overload.tolist()):
                if word & ~known:
                    events.append((float(rows.time_s[place]), "overload", word))
                    known = word
            self._reported = known
        return sorted(events)

    def _put_rows(self, rows: AmplifierRows, first: int, last: int) -> None:
        if last <= first:
            return
        sequence = self._sequence + np.arange(last - first)
        bits = self._profile.status_bits
        status = rows.overload[first:last].astype(np.int64)
        status |= int(self.physics.operating) << bits.operate | int(self._overrun) << bits.overrun
        ticks = np.rint(rows.device_s[first:last] * self._profile.ticks_per_s).astype(np.int64)
        data = self._encode_rows(sequence, ticks, status, rows.counts[first:last])
        size = len(data) // (last - first)
        self._out.append(RowBlock(data, size, rows.time_s[first:last], sequence))
        self._sequence += last - first

    def _put_event(self, event: str, detail: int, time_s: float, ready_s: float) -> None:
        kind = getattr(self._profile.events, event)
        data = encode_event(self._event, kind, self._sequence, self._ticks(time_s), detail)
        self._out.append(Unit(data, ready_s))

    def _ticks(self, time_s: float) -> int:
        return round(self.physics.device_s(time_s) * self._profile.ticks_per_s)


def _no_charges() -> NDArray[np.float64]:
    return np.zeros(CHANNELS)


def _number(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None
