"""`AmplifierDialogue`: requests to a charge amplifier and its answers, with deadlines."""

from __future__ import annotations

from config.cell.amplifier_profile import BAUD_RATES, AmplifierProfile
from config.cell.plate import CHANNEL_NAMES
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from drivers.amplifier.codec import AmplifierCodec, AmplifierReply, LineSplitter
from drivers.device_text import printable
from drivers.ports.serial_link import SerialLink

ANSWER_TIMEOUT_S = 2.0
PROBE_TIMEOUT_S = 0.15
ON, OFF = "1", "0"

_MAX_STALE_BYTES = 1 << 20


class AmplifierDialogue:
    """Requests over an open port, one after the other.

    Args:
        link: The port, open at the baud rate of the cell file.
        profile: The amplifier's commands.

    Attributes:
        lines: Received bytes that do not yet form a complete answer; after the start of a stream,
            the stream's first bytes.
    """

    def __init__(self, link: SerialLink, profile: AmplifierProfile) -> None:
        self.codec = AmplifierCodec(profile)
        self.lines = LineSplitter()
        self._link = link
        self._profile = profile
        self._baud_rate = link.baud_rate

    @property
    def where(self) -> str:
        """Name and address of the amplifier in messages."""
        return f"amplifier at {self._link.address}"

    def connect(self) -> str:
        """End a stream that is running; return maker, model and serial number.

        Raises:
            ProtocolError: The amplifier answers at another baud rate (the message names it), or its
                answer is not text.
            DeviceTimeoutError: There is no answer at any baud rate.
            TransportError: The port is lost.
        """
        try:
            return self._request_identity(ANSWER_TIMEOUT_S)
        except (DeviceTimeoutError, ProtocolError) as error:
            found = self._search_baud_rate()
            if found is None:
                if isinstance(error, ProtocolError):
                    raise
                raise DeviceTimeoutError(
                    f"{self.where}: no answer at any baud rate; check that the amplifier is on,"
                    " its cable (crossed or not) and plate.amplifier.address",
                    code="RID-AMPLIFIER-SILENT",
                ) from error
        raise ProtocolError(
            f"{self.where}: the amplifier answers at {found} baud, not at"
            f" {self._baud_rate}; set plate.amplifier.baud_rate to {found}, or the amplifier"
            f" to {self._baud_rate}",
            code="RID-AMPLIFIER-SETTING",
        )

    def ask(self, name: str, value: str | None = None, channel: int = 0) -> AmplifierReply:
        """Send a command that sets or reads a value; return the answer.

        Args:
            name: Field of `config.cell.amplifier_profile.Commands`.
            value: The value to set; None to read.
            channel: 1 to 8; 0 if the command applies to all channels, or to none.

        Raises:
            ProtocolError: The answer is an error, or not text.
            DeviceTimeoutError: The amplifier does not answer in time.
            TransportError: The port is lost.
        """
        clock = self._link.clock
        if self._link.read(clock.now_s()) or self.lines.rest:
            self.lines = LineSplitter()  # discard old data: no request was pending
        request = self.codec.request(name, value, channel)
        self._link.write(request)
        answer = self.answer(name, clock.now_s() + ANSWER_TIMEOUT_S)
        if answer.error:
            of = f" of {CHANNEL_NAMES[channel - 1]}" if channel else ""
            raise ProtocolError(
                f"{self.where}: {printable(request.strip())} ({name}{of}):"
                f" {self.codec.error_text(answer.error)}",
                code="RID-AMPLIFIER-ANSWER",
            )
        return answer

    def answer(self, name: str, until_s: float) -> AmplifierReply:
        """Wait for the answer's line; raise `DeviceTimeoutError` if it is not complete in time."""
        while (line := self.lines.next_line()) is None:
            data = self._link.read(until_s)
            if not data and self._link.clock.now_s() >= until_s:
                rest = self.lines.rest
                heard = f"; heard {printable(rest, 24)!r}" if rest else ""
                raise DeviceTimeoutError(
                    f"{self.where}: no answer to {name} at {self._link.baud_rate} baud{heard};"
                    " check cable and power",
                    code="RID-AMPLIFIER-SILENT",
                )
            self.lines.feed(data)
        return self.codec.read_answer(line)

    def unexpected(self, what: str, text: str) -> ProtocolError:
        """Return the error for an answer that does not match the amplifier's profile."""
        return ProtocolError(
            f"{self.where}: the answer to the request for {what} is {printable(text)!r}, which does"
            f" not match profile {self._profile.name}; correct the profile",
            code="RID-AMPLIFIER-ANSWER",
        )

    def _request_identity(self, timeout_s: float) -> str:
        """End a running stream; return the amplifier's maker, model and serial number."""
        clock = self._link.clock
        self.lines = LineSplitter()
        # the terminator at the beginning ends a line of noise that may be in the amplifier's input
        # buffer
        end = self._profile.terminator.encode("ascii")
        self._link.write(end + self.codec.request("stream", OFF))
        until_s = clock.now_s() + timeout_s
        heard, done = b"", self._profile.ok.text.encode("ascii")
        while not heard.rstrip(b"\r\n").endswith(done) or not heard.endswith((b"\r", b"\n")):
            data = self._link.read(until_s)
            if not data and clock.now_s() >= until_s:
                break
            heard = (heard + data)[-_MAX_STALE_BYTES:]
        self._link.write(self.codec.request("identify"))
        until_s = clock.now_s() + timeout_s
        while not (answer := self.answer("identify", until_s)).text:
            if answer.error:
                raise self.unexpected("who it is", f"E{answer.error}")
            # an empty answer is the late confirmation that the stream has ended
        return printable(answer.text)

    def _search_baud_rate(self) -> int | None:
        """Return the baud rate at which the amplifier answers; None if it never answers."""
        try:
            for baud_rate in BAUD_RATES:
                if baud_rate == self._baud_rate:
                    continue
                try:
                    self._link.set_baud_rate(baud_rate)
                except TransportError:
                    continue  # the adapter does not support this rate
                try:
                    self._request_identity(PROBE_TIMEOUT_S)
                except (DeviceTimeoutError, ProtocolError):
                    continue
                return baud_rate
            return None
        finally:
            self._link.set_baud_rate(self._baud_rate)
