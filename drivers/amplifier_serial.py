"""`SerialAmplifier`: a charge amplifier on a serial line, by its profile.

Every wait has a deadline. A range, a sensitivity or a filter is set only where it differs, because
some amplifiers lose the charge on their channels by it, and with that the plate's zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from config.amplifier_profile import BAUD_RATES, AmplifierProfile
from config.errors import DeviceTimeoutError, DriverError, ProtocolError, TransportError
from config.plate import CHANNEL_NAMES, CHANNELS, AmplifierConfig
from drivers.amplifier_codec import AmplifierCodec, Answer, LineSplitter
from drivers.amplifier_settings import RequiredSetting, required_settings
from drivers.amplifier_stream import AmplifierStream, StreamCounts
from drivers.device_text import printable
from drivers.interfaces import ForcePlate, PlateRead, PlateSetting
from drivers.simulated_arrivals import ArrivalReader, arrivals_path
from drivers.transport import SerialLink, open_serial

ANSWER_TIMEOUT_S = 0.5
PROBE_TIMEOUT_S = 0.15
ON, OFF = "1", "0"

_MAX_STALE_BYTES = 1 << 20


class SerialAmplifier(ForcePlate):
    """The amplifier behind an open port.

    Parameters
    ----------
    link : SerialLink
        The port.
    config : AmplifierConfig
        What is required of the amplifier.
    profile : AmplifierProfile
        What it speaks.
    arrivals : ArrivalReader, optional
        Where a simulated amplifier says when its rows arrive, if time itself is simulated.
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
        self._codec = AmplifierCodec(profile)
        self._arrivals = arrivals
        self._lines = LineSplitter()
        self._stream: AmplifierStream | None = None
        self._counts = StreamCounts()

    @property
    def stream_counts(self) -> StreamCounts:
        """What the stream under way, or the last one, has brought."""
        return self._counts

    def connect(self) -> str:
        """End a stream that is under way; return who answers.

        Raises
        ------
        ProtocolError
            The amplifier answers at another speed, which is named, or answers no text.
        DeviceTimeoutError
            Nothing answers at any speed.
        TransportError
            The port is gone.
        """
        try:
            return self._greet(ANSWER_TIMEOUT_S)
        except (DeviceTimeoutError, ProtocolError) as error:
            found = self._search()
            if found is None:
                if isinstance(error, ProtocolError):
                    raise
                raise DeviceTimeoutError(
                    f"{self._where}: nothing answers at any speed; check that the amplifier is on,"
                    " its cable (crossed or not) and plate.amplifier.address"
                ) from error
        raise ProtocolError(
            f"{self._where}: the amplifier answers at {found} baud, not at"
            f" {self._config.baud_rate}: set plate.amplifier.baud_rate to {found}, or the amplifier"
            f" to {self._config.baud_rate}"
        )

    def settings(self) -> tuple[PlateSetting, ...]:
        """Read every setting back; nothing is changed.

        Raises
        ------
        DriverError
            The amplifier does not answer, or not as its profile says.
        """
        return tuple(self._check(wanted) for wanted in required_settings(self._config))

    def configure(self) -> bool:
        """Change the settings that differ and read them back.

        Returns
        -------
        bool
            Whether that lost the charges on the channels: zero must be made again.

        Raises
        ------
        ProtocolError
            A setting is refused, or reads back differently.
        DriverError
            The amplifier does not answer.
        """
        charge_lost = False
        for wanted in required_settings(self._config):
            if self._check(wanted).verdict == "ok":
                continue
            if not wanted.is_settable:
                raise ProtocolError(
                    f"{self._where}: {wanted.label} is {self._check(wanted).found}, the cell file"
                    f" says {wanted.text}: correct the cell file"
                )
            charge_lost |= self._ask(wanted.name, wanted.text, wanted.channel).charge_lost
            found = self._check(wanted)
            if found.verdict != "ok":
                raise ProtocolError(
                    f"{self._where}: {wanted.label} was set to {wanted.text} and reads back"
                    f" {found.found}: choose a value that the amplifier has"
                )
        return charge_lost

    def operate(self) -> None:
        """Measure from now on; raises `DriverError` when the amplifier does not go along."""
        self._switch(ON, "operate")

    def reset(self) -> None:
        """Discharge the channels; raises `DriverError` when the amplifier does not go along."""
        self._switch(OFF, "reset")

    def is_operating(self) -> bool:
        """Return whether the channels measure; raises `DriverError`."""
        text = self._ask("operate").text
        if text not in (ON, OFF):
            raise self._unexpected("operate or reset", text)
        return text == ON

    def take_overloads(self) -> tuple[bool, ...]:
        """Return which channels were overloaded since the last call, and forget it.

        Raises
        ------
        DriverError
            The amplifier does not answer, or not as its profile says.
        """
        text = self._ask("overload").text
        try:
            word = int(text, 16)
        except ValueError:
            word = -1
        if not 0 <= word < 1 << CHANNELS:
            raise self._unexpected("overloads", text)
        return tuple(bool(word >> channel & 1) for channel in range(CHANNELS))

    def forces_n(self) -> NDArray[np.float64]:
        """Return what the channels measure now [N], shape (8,); raises `DriverError`."""
        text = self._ask("values").text
        try:
            values = np.array([float(part) for part in text.split(",")])
        except ValueError:
            raise self._unexpected("eight forces", text) from None
        if values.shape != (CHANNELS,) or not np.isfinite(values).all():
            raise self._unexpected("eight forces", text)
        return values

    def start(self) -> None:
        """Begin the stream of rows; raises `DriverError` when the amplifier does not go along."""
        self._ask("stream", ON)
        self._stream = AmplifierStream(self.profile, self._config.format, self._config.rate_hz)
        self._counts = self._stream.counts

    def read(self, until_s: float) -> PlateRead:
        """Return what has come, waiting for it until `until_s` [s, monotonic clock].

        Raises
        ------
        TransportError
            The port is gone.
        ProtocolError
            No stream was started.
        """
        if self._stream is None:
            raise ProtocolError(f"{self._where}: no stream was started")
        waiting, self._lines.rest = self._lines.rest, b""
        block = self._stream.feed(waiting or self._link.read(until_s))
        read_s = self._link.last_time_s
        if self._arrivals is None:
            arrival_s = np.full(len(block.rows), read_s)
        else:
            arrival_s = self._arrivals.time_s(block.rows["sequence"])
        return PlateRead(block.rows, block.events, arrival_s, read_s)

    def mark(self) -> float:
        """Ask for the device's time within the stream; the answer is an event.

        Returns
        -------
        float
            When the question had been handed to the port [s, monotonic clock].
        """
        self._link.write(self._codec.request("time"))
        return self._link.clock.now_s()

    def stop(self, until_s: float) -> tuple[PlateRead, ...]:
        """End the stream and return what came until then.

        Raises
        ------
        DeviceTimeoutError
            The amplifier did not confirm it until `until_s` [s, monotonic clock].
        TransportError
            The port is gone.
        """
        stream = self._stream
        if stream is None:
            return ()
        self._link.write(self._codec.request("stream", OFF))
        reads = []
        while not stream.stopped:
            read = self.read(until_s)
            reads.append(read)
            if not stream.stopped and self._link.clock.now_s() >= until_s:
                self._stream = None
                raise DeviceTimeoutError(f"{self._where}: the amplifier does not end its stream")
        self._stream = None
        self._lines.rest = b""
        self._lines.feed(stream.rest)
        self._answer("stream", max(until_s, self._link.clock.now_s() + ANSWER_TIMEOUT_S))
        return tuple(reads)

    @property
    def _where(self) -> str:
        return f"amplifier at {self._link.address}"

    def _greet(self, timeout_s: float) -> str:
        """End whatever is under way and ask who is there."""
        self._stream = None
        clock = self._link.clock
        self._lines = LineSplitter()
        # the first terminator ends what noise has left in the amplifier's input
        end = self.profile.terminator.encode("ascii")
        self._link.write(end + self._codec.request("stream", OFF))
        until_s = clock.now_s() + timeout_s
        heard, done = b"", self.profile.ok.text.encode("ascii")
        while not heard.rstrip(b"\r\n").endswith(done) or not heard.endswith((b"\r", b"\n")):
            data = self._link.read(until_s)
            if not data and clock.now_s() >= until_s:
                break
            heard = (heard + data)[-_MAX_STALE_BYTES:]
        self._link.write(self._codec.request("identify"))
        answer = self._answer("identify", clock.now_s() + timeout_s)
        if not answer.text:
            raise self._unexpected("who it is", answer.error and f"E{answer.error}")
        return printable(answer.text)

    def _search(self) -> int | None:
        """Return the speed at which the amplifier answers; None where it is silent at all."""
        try:
            for baud_rate in BAUD_RATES:
                if baud_rate == self._config.baud_rate:
                    continue
                try:
                    self._link.set_baud_rate(baud_rate)
                except TransportError:
                    continue  # this adapter does not have it
                try:
                    self._greet(PROBE_TIMEOUT_S)
                except (DeviceTimeoutError, ProtocolError):
                    continue
                return baud_rate
            return None
        finally:
            self._link.set_baud_rate(self._config.baud_rate)

    def _switch(self, value: str, what: str) -> None:
        self._ask("operate", value)
        if self.is_operating() != (value == ON):
            raise ProtocolError(f"{self._where}: took the command and did not {what}")

    def _check(self, wanted: RequiredSetting) -> PlateSetting:
        text = self._ask(wanted.name, channel=wanted.channel).text
        return PlateSetting(
            name=wanted.label,
            channel=wanted.channel,
            required=wanted.shown(wanted.text),
            found=wanted.shown(printable(text)),
            verdict="ok" if wanted.agrees(text) else "red",
        )

    def _ask(self, name: str, value: str | None = None, channel: int = 0) -> Answer:
        """Set or ask something; an error that is answered is raised."""
        if self._stream is not None:
            raise ProtocolError(f"{self._where}: {name} cannot be asked while rows are streaming")
        clock = self._link.clock
        if self._link.read(clock.now_s()) or self._lines.rest:
            self._lines = LineSplitter()  # nothing was asked, so this answers nothing
        request = self._codec.request(name, value, channel)
        self._link.write(request)
        answer = self._answer(name, clock.now_s() + ANSWER_TIMEOUT_S)
        if answer.error:
            of = f" of {CHANNEL_NAMES[channel - 1]}" if channel else ""
            raise ProtocolError(
                f"{self._where}: {printable(request.strip())} ({name}{of}):"
                f" {self._codec.error_text(answer.error)}"
            )
        return answer

    def _answer(self, name: str, until_s: float) -> Answer:
        """Wait for the next line; raises `DeviceTimeoutError` where none ends in time."""
        while (line := self._lines.next_line()) is None:
            data = self._link.read(until_s)
            if not data and self._link.clock.now_s() >= until_s:
                rest = self._lines.rest
                heard = f"; heard {printable(rest, 24)!r}" if rest else ""
                raise DeviceTimeoutError(
                    f"{self._where}: no answer to {name} at {self._link.baud_rate} baud{heard}"
                )
            self._lines.feed(data)
        return self._codec.read_answer(line)

    def _unexpected(self, what: str, text: str) -> ProtocolError:
        return ProtocolError(
            f"{self._where}: asked for {what}, answered {printable(text)!r}: not what profile"
            f" {self.profile.name} says"
        )


@contextmanager
def open_amplifier(config: AmplifierConfig, profile: AmplifierProfile) -> Iterator[SerialAmplifier]:
    """Open the amplifier's port; nothing is sent yet. Leaving ends a stream and closes the port.

    Raises
    ------
    TransportError
        The port cannot be opened.
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
    """End a stream that is still under way, if the line is still there."""
    try:
        amplifier.stop(link.clock.now_s() + ANSWER_TIMEOUT_S)
    except DriverError:
        return  # the line is gone, or the amplifier: there is nothing left to end
