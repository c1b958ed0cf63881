"""Commands and answers of a charge amplifier, by its profile: text lines, both directions.

A command is an optional channel (``3:``), a mnemonic, and a value or the query sign; the answer is
a value, OK or an error's number. Rows and events are `amplifier_stream`'s.
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
class Request:
    """A command as the device understands it.

    Attributes:
        name: Field of `config.cell.amplifier_profile.Commands`.
        channel: 1 to 8, 0 for all or none.
        value: What to set; None for a question.
    """

    name: str
    channel: int
    value: str | None


@dataclass(frozen=True, slots=True)
class Answer:
    """What the device said.

    Attributes:
        text: The value asked for; empty after OK.
        error: The error's number, empty where there is none.
        charge_lost: The setting was taken and the charge on the channels with it: zero must be made
            again.
    """

    text: str = ""
    error: str = ""
    charge_lost: bool = False


class RequestError(ProtocolError):
    """An invalid command; `number` is the error that the device answers."""

    def __init__(self, number: str, text: str) -> None:
        super().__init__(text, code="RID-AMPLIFIER-ANSWER")
        self.number = number


class AmplifierCodec:
    """Lines to commands and answers, and back; no state, no input or output."""

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
        """Return a command: `value` to set, None to ask.

        Args:
            name: Field of `config.cell.amplifier_profile.Commands`.
            value: What to set.
            channel: 1 to 8; 0 leaves it out.
        """
        start = f"{channel}{self.profile.channel_separator}" if channel else ""
        rest = self.profile.query if value is None else value
        return f"{start}{self._words[name]}{rest}".encode("ascii") + self._end

    def read_request(self, line: bytes) -> Request:
        """Understand a command, given without its terminator: the device's side.

        Raises:
            RequestError: It is none, or names a channel that is not there.
        """
        match = self._request.fullmatch(line.decode("latin-1"))
        if match is None or not match[3]:
            raise RequestError(UNKNOWN_COMMAND, f"{printable(line)!r} is no command")
        channel = int(match[1] or ALL_CHANNELS)
        if channel > CHANNELS:
            raise RequestError(NO_SUCH_CHANNEL, f"channel {channel} of {CHANNELS}")
        value = None if match[3] == self.profile.query else match[3]
        return Request(self._names[match[2]], channel, value)

    def answer(self, answer: Answer) -> bytes:
        """Return an answer as the device sends it: an error, a value, or OK."""
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

    def read_answer(self, line: bytes) -> Answer:
        """Understand an answer, given without its terminator.

        Raises:
            ProtocolError: It is empty, or not text.
        """
        text = line.decode("latin-1").strip(" ")
        if not text or not (text.isascii() and text.isprintable()):
            raise ProtocolError(
                f"the amplifier answered {printable(line)!r}, which is no text",
                code="RID-AMPLIFIER-ANSWER",
            )
        if text == self.profile.ok.text:
            return Answer()
        if text == f"{self.profile.ok.text},{self.profile.charge_lost.text}":
            return Answer(charge_lost=True)
        match = self._error.fullmatch(text)
        return Answer(error=match[1]) if match else Answer(text=text)

    def error_text(self, number: str) -> str:
        """Return an error in words, for people."""
        meaning = self.profile.errors.get(number, "not in the profile's list")
        return f"error {self.profile.error.text}{number} ({meaning})"


class LineSplitter:
    """Bytes to lines ended by CR, LF or both; bounded, whatever comes.

    Attributes:
        rest: What came after the last line's end.
    """

    def __init__(self) -> None:
        self.rest = b""

    def feed(self, data: bytes) -> None:
        """Take bytes in; `next_line` then takes them out."""
        self.rest += data

    def next_line(self) -> bytes | None:
        """Take out the next line that is not empty; None where none has ended.

        Of a line that grows too long before it ends only the last bytes are kept.
        """
        while (end := _LINE_END.search(self.rest)) is not None:
            line, self.rest = self.rest[: end.start()], self.rest[end.end() :]
            if line:
                return line[-MAX_LINE_BYTES:]
        self.rest = self.rest[-MAX_LINE_BYTES:]
        return None
