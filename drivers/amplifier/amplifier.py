"""`SerialAmplifier`: driver of a charge amplifier on a serial line; a profile defines its commands.

Every wait has a deadline. A range, a sensitivity or a filter is written only if it differs from the
required value: the write discharges the channels of some amplifiers, and the plate's zero is then
lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import CHANNELS, AmplifierConfig
from config.errors import DeviceTimeoutError, DriverError, ProtocolError
from drivers.amplifier.codec import AmplifierReply
from drivers.amplifier.dialogue import ANSWER_TIMEOUT_S, OFF, ON, AmplifierDialogue
from drivers.amplifier.settings import RequiredSetting, required_settings
from drivers.amplifier.simulated_arrivals import ArrivalReader, arrivals_path
from drivers.amplifier.stream import AmplifierStream, StreamCounts
from drivers.device_text import printable
from drivers.interfaces.force_plate import ForcePlate, PlateRead, PlateSetting
from drivers.ports.serial_link import SerialLink, open_serial


class SerialAmplifier(ForcePlate):
    """Charge amplifier that is connected to an open serial port.

    Args:
        link: The port.
        config: The required settings.
        profile: The amplifier's commands and rows.
        arrivals: Source of the rows' arrival times, for an amplifier that is simulated in simulated
            time; None for any other.
    """

    def __init__(
        self,
        link: SerialLink,
        config: AmplifierConfig,
        profile: AmplifierProfile,
        arrivals: ArrivalReader | None = None,
    ) -> None:
        self.profile = profile
        self._link = link
        self._config = config
        self._dialogue = AmplifierDialogue(link, profile)
        self._arrivals = arrivals
        self._stream: AmplifierStream | None = None
        self._pieces: list[bytes] = []
        self._piece_ends: list[int] = []
        self._piece_times_s: list[float] = []
        self._counts = StreamCounts()

    @property
    def stream_counts(self) -> StreamCounts:
        """Counts of rows and errors in the current stream; after its end, in the last stream."""
        return self._counts

    def connect(self) -> str:
        """End a stream that is running; return maker, model and serial number.

        Raises:
            ProtocolError: The amplifier answers at another baud rate (the message names it), or its
                answer is not text.
            DeviceTimeoutError: There is no answer at any baud rate.
            TransportError: The port is lost.
        """
        self._stream = None
        return self._dialogue.connect()

    def settings(self) -> tuple[PlateSetting, ...]:
        """Read every setting from the amplifier, without changing any.

        Raises:
            DriverError: The amplifier does not answer, or violates its profile.
        """
        return tuple(self._compare(wanted) for wanted in required_settings(self._config))

    def configure(self) -> bool:
        """Change the settings that differ and read them back.

        Returns:
            True if a change discharged the channels, so that the plate must be zeroed again.

        Raises:
            ProtocolError: A setting is refused, or reads back differently.
            DriverError: The amplifier does not answer.
        """
        charge_lost = False
        for wanted in required_settings(self._config):
            if self._compare(wanted).verdict == "ok":
                continue
            if not wanted.is_settable:
                raise ProtocolError(
                    f"{self._where}: {wanted.label} is {self._compare(wanted).found}, but"
                    f" {wanted.text} in the cell file; correct the cell file",
                    code="RID-AMPLIFIER-SETTING",
                )
            charge_lost |= self._ask(wanted.name, wanted.text, wanted.channel).charge_lost
            found = self._compare(wanted)
            if found.verdict != "ok":
                raise ProtocolError(
                    f"{self._where}: {wanted.label} was set to {wanted.text} but reads back"
                    f" {found.found}; choose a value that the amplifier supports",
                    code="RID-AMPLIFIER-SETTING",
                )
        return charge_lost

    def operate(self) -> None:
        """Start the measurement; raise `DriverError` if the amplifier does not start it."""
        self._switch(ON, "operate")

    def reset(self) -> None:
        """Discharge the channels; raise `DriverError` if the amplifier does not do this."""
        self._switch(OFF, "reset")

    def is_operating(self) -> bool:
        """Return True if the channels are measuring; may raise `DriverError`."""
        text = self._ask("operate").text
        if text not in (ON, OFF):
            raise self._dialogue.unexpected("operate or reset", text)
        return text == ON

    def take_overloads(self) -> tuple[bool, ...]:
        """Return a flag per channel, True after an overload since the last call; clear the flags.

        Raises:
            DriverError: The amplifier does not answer, or violates its profile.
        """
        text = self._ask("overload").text
        try:
            word = int(text, 16)
        except ValueError:
            word = -1
        if not 0 <= word < 1 << CHANNELS:
            raise self._dialogue.unexpected("overloads", text)
        return tuple(bool(word >> channel & 1) for channel in range(CHANNELS))

    def forces_n(self) -> NDArray[np.float64]:
        """Return the present forces of the channels [N], shape (8,); may raise `DriverError`."""
        text = self._ask("values").text
        try:
            values = np.array([float(part) for part in text.split(",")])
        except ValueError:
            raise self._dialogue.unexpected("eight forces", text) from None
        if values.shape != (CHANNELS,) or not np.isfinite(values).all():
            raise self._dialogue.unexpected("eight forces", text)
        return values

    def start(self) -> None:
        """Start the stream of rows; raise `DriverError` if the amplifier does not start it."""
        self._ask("stream", ON)
        self._clear_pieces()
        self._stream = AmplifierStream(self.profile, self._config.format, self._config.rate_hz)
        self._counts = self._stream.counts

    def gather(self, until_s: float) -> bool:
        """Store incoming data until `until_s` [s, monotonic clock], for `read`.

        It is faster than `read`: it needs only one or two system calls, however many bytes arrive.

        Returns:
            True if data arrived.

        Raises:
            TransportError: The port is lost.
            ProtocolError: No stream was started.
        """
        if self._stream is None:
            raise ProtocolError(f"{self._where}: no stream was started", code="RID-INTERNAL-ERROR")
        lines = self._dialogue.lines
        piece, lines.rest = lines.rest, b""
        piece = piece or self._link.read(until_s)
        if piece:
            end = self._piece_ends[-1] if self._piece_ends else self._stream.received_bytes
            self._pieces.append(piece)
            self._piece_ends.append(end + len(piece))
            self._piece_times_s.append(self._link.last_time_s)
        return bool(piece)

    def read(self, until_s: float) -> PlateRead:
        """Receive data as `gather` does, then return all data since the last call of `read`.

        Raises:
            TransportError: The port is lost.
            ProtocolError: No stream was started.
        """
        self.gather(until_s)
        assert self._stream is not None
        block = self._stream.feed(b"".join(self._pieces))
        ends, times_s = self._piece_ends, np.array(self._piece_times_s)
        event_arrival_s = times_s[np.searchsorted(ends, block.event_ends)]
        if self._arrivals is None:
            arrival_s = times_s[np.searchsorted(ends, block.row_ends)]
        else:
            arrival_s = self._arrivals.time_s(block.rows["sequence"])
        self._clear_pieces()
        return PlateRead(
            block.rows, block.events, arrival_s, event_arrival_s, self._link.last_time_s
        )

    def mark(self) -> float:
        """Request the amplifier's clock time during a stream; the answer is an event in the stream.

        Returns:
            Time just before the request was sent [s, monotonic clock].
        """
        asked_s = self._link.clock.now_s()
        self._link.write(self._dialogue.codec.request("time"))
        return asked_s

    def forget_overloads(self) -> None:
        """Request the overloads during a stream; the answer is an event in the stream.

        The request also clears the flags of past overloads in the status of the rows that follow.

        Raises:
            TransportError: The port is lost.
        """
        self._link.write(self._dialogue.codec.request("overload"))

    def stop(self, until_s: float) -> tuple[PlateRead, ...]:
        """End the stream; return the data that arrived before its end.

        Raises:
            DeviceTimeoutError: The amplifier did not confirm the end of the stream by `until_s` [s,
                monotonic clock].
            TransportError: The port is lost.
        """
        stream = self._stream
        if stream is None:
            return ()
        self._link.write(self._dialogue.codec.request("stream", OFF))
        reads = []
        while not stream.stopped:
            read = self.read(until_s)
            reads.append(read)
            if not stream.stopped and self._link.clock.now_s() >= until_s:
                self._stream = None
                raise DeviceTimeoutError(
                    f"{self._where}: the amplifier does not end its stream; check cable and power",
                    code="RID-AMPLIFIER-SILENT",
                )
        self._stream = None
        lines = self._dialogue.lines
        lines.rest = b""
        lines.feed(stream.rest)
        self._dialogue.answer("stream", max(until_s, self._link.clock.now_s() + ANSWER_TIMEOUT_S))
        return tuple(reads)

    def _clear_pieces(self) -> None:
        self._pieces, self._piece_ends, self._piece_times_s = [], [], []

    @property
    def _where(self) -> str:
        return self._dialogue.where

    def _ask(self, name: str, value: str | None = None, channel: int = 0) -> AmplifierReply:
        if self._stream is not None:
            raise ProtocolError(
                f"{self._where}: {name} cannot be read while rows are streaming",
                code="RID-INTERNAL-ERROR",
            )
        return self._dialogue.ask(name, value, channel)

    def _switch(self, value: str, what: str) -> None:
        self._ask("operate", value)
        if self.is_operating() != (value == ON):
            raise ProtocolError(
                f"{self._where}: accepted the command but did not {what}; check the amplifier",
                code="RID-AMPLIFIER-ANSWER",
            )

    def _compare(self, wanted: RequiredSetting) -> PlateSetting:
        text = self._ask(wanted.name, channel=wanted.channel).text
        return PlateSetting(
            name=wanted.label,
            channel=wanted.channel,
            required=wanted.shown(wanted.text),
            found=wanted.shown(printable(text)),
            verdict="ok" if wanted.agrees(text) else "red",
        )


@contextmanager
def open_amplifier(config: AmplifierConfig, profile: AmplifierProfile) -> Iterator[SerialAmplifier]:
    """Open the amplifier's port without sending; at the end stop the stream and close the port.

    Raises:
        TransportError: The port cannot be opened.
    """
    with open_serial(config.address, config.baud_rate) as link:
        path = arrivals_path(config.address)
        arrivals = ArrivalReader(path) if path.exists() else None
        try:
            amplifier = SerialAmplifier(link, config, profile, arrivals)
            try:
                yield amplifier
            finally:
                _end_stream(amplifier, link)
        finally:
            if arrivals is not None:
                arrivals.close()


def _end_stream(amplifier: SerialAmplifier, link: SerialLink) -> None:
    """End a stream that is still running; ignore a lost line or amplifier."""
    try:
        amplifier.stop(link.clock.now_s() + ANSWER_TIMEOUT_S)
    except DriverError:
        return  # if the line or the amplifier is lost, the stream cannot be stopped
