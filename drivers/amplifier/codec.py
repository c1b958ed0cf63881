"""Commands and answers of a charge amplifier: text lines whose words the profile defines.

A command is an optional channel (``3:``), a mnemonic, and a value or the query sign. The answer is
a value, OK or an error number. Rows and events are in `drivers.amplifier.stream`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import CHANNELS
from config.errors import ProtocolError
from drivers.device_text import printable

MAX_LINE_BYTES: Final = 256
ALL_CHANNELS: Final = 0
UNKNOWN_COMMAND: Final = "01"
NO_SUCH_CHANNEL: Final = "04"

_LINE_END = re.compile(rb"[\r\n]")


@dataclass(frozen=True, slots=True)
class AmplifierCommand:
    """A command to the amplifier.

    Attributes:
        name: Field of `config.cell.amplifier_profile.Commands`.
        channel: 1 to 8; 0 if the command applies to all channels, or to none.
        value: The value to set; None for a query.
    """

    name: str
    channel: int
    value: str | None


@dataclass(frozen=True, slots=True)
class AmplifierReply:
    """An answer of the amplifier.

    Attributes:
        text: The requested value; empty if the answer was only OK.
        error: The error number; empty if there was no error.
        charge_lost: The setting was accepted but discharged the channels, so that the plate must be
            zeroed again.
    """

    text: str = ""
    error: str = ""
    charge_lost: bool = False


class RequestError(ProtocolError):
    """The amplifier received an invalid command; `number` is the error number of its answer."""

    def __init__(self, number: str, text: str) -> None:
        super().__init__(text, code="RID-AMPLIFIER-ANSWER")
        self.number = number


class AmplifierCodec:
    """Converts text lines to commands and answers, and back; without state, input or output."""

    def __init__(self, profile: AmplifierProfile) -> None:
        self.profile = profile
        self._end = profile.terminator.encode("ascii")
        self._words = {name: word.text for name, word in profile.commands}
        self._names = {word: name for name, word in self._words.items()}
        words = "|".join(re.escape(word) for word in sorted(self._names, key=len, reverse=True))
        self._request = re.compile(
            rf"(?:(\d{{1,3}}){re.escape(profile.channel_separator)})?({words})([!-~]*)"
        )
        self._error = re.compile(rf"{re.escape(profile.error.text)}(\d{{1,4}})")

    def request(self, name: str, value: str | None = None, channel: int = ALL_CHANNELS) -> bytes:
        """Return the bytes of a command that sets `value`; if `value` is None, those of a query.

        Args:
            name: Field of `config.cell.amplifier_profile.Commands`.
            value: The value to set.
            channel: 1 to 8; with 0 the command names no channel.
        """
        start = f"{channel}{self.profile.channel_separator}" if channel else ""
        rest = self.profile.query if value is None else value
        return f"{start}{self._words[name]}{rest}".encode("ascii") + self._end

    def read_request(self, line: bytes) -> AmplifierCommand:
        """Parse a command line without its terminator, as the (simulated) amplifier does.

        Raises:
            RequestError: The line is not a command, or its channel does not exist.
        """
        match = self._request.fullmatch(line.decode("latin-1"))
        if match is None or not match[3]:
            raise RequestError(UNKNOWN_COMMAND, f"{printable(line)!r} is not a command")
        channel = int(match[1] or ALL_CHANNELS)
        if channel > CHANNELS:
            raise RequestError(NO_SUCH_CHANNEL, f"channel {channel} of {CHANNELS}")
        value = None if match[3] == self.profile.query else match[3]
        return AmplifierCommand(self._names[match[2]], channel, value)

    def answer(self, answer: AmplifierReply) -> bytes:
        """Return the bytes of an amplifier's answer: an error, a value, or OK."""
        profile = self.profile
        if answer.error:
            text = f"{profile.error.text}{answer.error}"
        elif answer.text:
            text = answer.text
        elif answer.charge_lost:
            text = f"{profile.ok.text},{profile.charge_lost.text}"
        else:
            text = profile.ok.text
        return text.encode("ascii") + self._end

    def read_answer(self, line: bytes) -> AmplifierReply:
        """Parse an answer line without its terminator.

        Raises:
            ProtocolError: The line is empty, or is not text.
        """
        text = line.decode("latin-1").strip(" ")
        if not text or not (text.isascii() and text.isprintable()):
            raise ProtocolError(
                f"the amplifier answered {printable(line)!r}, which is not text; check baud rate"
                " and cable",
                code="RID-AMPLIFIER-ANSWER",
            )
        if text == self.profile.ok.text:
            return AmplifierReply()
        if text == f"{self.profile.ok.text},{self.profile.charge_lost.text}":
            return AmplifierReply(charge_lost=True)
        match = self._error.fullmatch(text)
        return AmplifierReply(error=match[1]) if match else AmplifierReply(text=text)

    def error_text(self, number: str) -> str:
        """Return the description of an error number."""
        meaning = self.profile.errors.get(number, "not in the profile's list")
        return f"error {self.profile.error.text}{number} ({meaning})"


class LineSplitter:
    """Splitter of bytes into lines that end with CR, LF or both; its memory is limited.

    Attributes:
        rest: Bytes after the last line.
    """

    def __init__(self) -> None:
        self.rest = b""

    def feed(self, data: bytes) -> None:
        """Append received bytes; `next_line` returns the lines in them."""
        self.rest += data

    def next_line(self) -> bytes | None:
        """Remove and return the next line that is not empty; None if no line is complete yet.

        If a line is too long, only its last bytes are kept.
        """
        while (end := _LINE_END.search(self.rest)) is not None:
            line, self.rest = self.rest[: end.start()], self.rest[end.end() :]
            if line:
                return line[-MAX_LINE_BYTES:]
        self.rest = self.rest[-MAX_LINE_BYTES:]
        return None
