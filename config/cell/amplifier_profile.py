"""`AmplifierProfile`: the commands and answers of an amplifier, and the layout of its rows.

A profile is data, so that another device only needs another file. This module also computes the
load that a stream of rows puts on the serial line, because a stream that the line cannot carry must
be refused before a cell is used.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from config.cell.plate import CHANNELS, AmplifierConfig
from config.errors import ConfigError
from config.model import ConfigModel

BITS_PER_BYTE: Final = 10  # start bit, eight data bits, stop bit
LINE_LOAD_LIMIT: Final = 0.95
BAUD_RATES: Final = (
    9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600, 1_000_000, 2_000_000, 3_000_000,
)  # fmt: skip

_ROW_FIELDS: Final = ("sequence", "time", "status", "counts", "checksum")
_EVENT_FIELDS: Final = ("kind", "sequence", "time", "detail", "checksum")
_HEX_WIDTHS: Final = {"kind": 2, "sequence": 4, "time": 8, "status": 4, "detail": 4, "checksum": 4}
_BINARY_KINDS: Final = {
    "kind": "u2", "sequence": "u2", "time": "u4", "status": "u2", "counts": "i2", "detail": "u2",
    "checksum": "u2",
}  # fmt: skip
_PART = re.compile(r"\{(?P<name>[a-z]+):(?P<kind>hex|dec|u|i)(?P<width>\d)\}|(?P<literal>[^{}]+)")

Token = Annotated[str, Field(pattern=r"^[!-~]{1,8}$")]
Symbol = Annotated[str, Field(pattern=r"^[!-/:-@]$")]


class Word(ConfigModel):
    """A string of the device's protocol.

    Attributes:
        text: The string.
        verified: True if the string was seen in use on a real device.
        source: Place, such as a manual, in which the string was seen.
    """

    text: Token
    verified: bool = False
    source: str = ""

    @model_validator(mode="after")
    def _check_source(self) -> Word:
        if self.verified and not self.source:
            raise ValueError(
                f"{self.text!r} has verified: true; state in `source` where it was seen"
            )
        return self


class Commands(ConfigModel):
    """The mnemonics of the commands to an amplifier.

    Attributes:
        operate: Switch the amplifier to Operate or to Reset.
        identify: Ask for maker, model, serial number and firmware.
        range: Set the full scale of a channel [N].
        sensitivity: Set the sensitivity of a channel's sensor [pC/N].
        low_pass: Set the cut-off frequency of the low-pass filter [Hz].
        overload: Ask for the channels that are or were overloaded.
        values: Ask for the forces of all channels.
        bits: Ask for the resolution of the converter.
        rate: Set the number of rows per second.
        format: Set the format of the rows.
        trigger: Switch the events of the trigger input on or off.
        stream: Start or stop the rows.
        time: Ask for the device's clock [ticks].
    """

    operate: Word
    identify: Word
    range: Word
    sensitivity: Word
    low_pass: Word
    overload: Word
    values: Word
    bits: Word
    rate: Word
    format: Word
    trigger: Word
    stream: Word
    time: Word


class Events(ConfigModel):
    """Numbers of the events that the amplifier sends between its rows.

    Attributes:
        overload: Channels are overloaded.
        overrun: Rows were lost.
        trigger: An edge at the trigger input.
        mark: Answer to a request for the time.
        stopped: The rows end.
    """

    overload: Annotated[int, Field(ge=0, le=255)]
    overrun: Annotated[int, Field(ge=0, le=255)]
    trigger: Annotated[int, Field(ge=0, le=255)]
    mark: Annotated[int, Field(ge=0, le=255)]
    stopped: Annotated[int, Field(ge=0, le=255)]


class StatusBits(ConfigModel):
    """The bits of a row's status word; its bits 0 to 7 report overloads of the channels.

    Attributes:
        operate: The amplifier measures.
        overrun: Rows were lost.
    """

    operate: Annotated[int, Field(ge=8, le=15)]
    overrun: Annotated[int, Field(ge=8, le=15)]


@dataclass(frozen=True, slots=True)
class Part:
    """A piece of a row: a literal, or `repeat` numbers of `width` characters or bytes."""

    name: str
    kind: Literal["literal", "hex", "dec", "u", "i"]
    width: int
    repeat: int = 1
    literal: bytes = b""

    @property
    def size(self) -> int:
        """Length of the piece in a row [bytes]."""
        return self.width * self.repeat


class FrameTemplates(ConfigModel):
    """Layout of a row and of an event: literals and fields such as `{sequence:hex4}`.

    Attributes:
        row: Template of a row.
        event: Template of an event.
    """

    row: str = Field(max_length=200)
    event: str = Field(max_length=200)


class AmplifierProfile(ConfigModel):
    """The strings and rows of one type of amplifier.

    Attributes:
        name: Name of the profile.
        summary: One sentence about the protocol.
        terminator: End of each line.
        query: Character that makes a command a query.
        channel_separator: Character between the number of a channel and the command.
        ok: Answer if the command was executed.
        error: Answer if the command was refused; a number of `errors` follows.
        charge_lost: Text after `ok` if the command discharged the channels.
        commands: The mnemonics.
        errors: Meaning of each error number.
        ticks_per_s: Frequency of the device's clock.
        ascii: Layout of the rows and events in the text format.
        binary: Layout of the rows and events in the binary format.
        status_bits: Bits of a row's status.
        events: Numbers of the events.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    summary: str
    terminator: Literal["\r", "\n", "\r\n"]
    query: Symbol
    channel_separator: Symbol
    ok: Word
    error: Word
    charge_lost: Word
    commands: Commands
    errors: dict[str, str]
    ticks_per_s: Annotated[int, Field(ge=1000, le=1_000_000_000)]
    ascii: FrameTemplates
    binary: FrameTemplates
    status_bits: StatusBits
    events: Events

    @model_validator(mode="after")
    def _check_twins(self) -> AmplifierProfile:
        words = [word.text for _, word in self.commands]
        _refuse_twins("commands", words)
        _refuse_twins("events", [number for _, number in self.events])
        _refuse_twins("status_bits", [bit for _, bit in self.status_bits])
        for name in ("ascii", "binary"):
            row, event = self.row_parts(name), self.event_parts(name)
            if row[0].literal == event[0].literal:
                raise ValueError(
                    f"{name}: row and event begin with the same literal {row[0].literal!r}; give"
                    " them different ones"
                )
        return self

    def row_parts(self, form: str) -> tuple[Part, ...]:
        """Return the parts of a row in the form ``ascii`` or ``binary``, without terminator."""
        return _parts(self._templates(form).row, form, _ROW_FIELDS)

    def event_parts(self, form: str) -> tuple[Part, ...]:
        """Return the parts of an event in the form ``ascii`` or ``binary``."""
        return _parts(self._templates(form).event, form, _EVENT_FIELDS)

    def row_bytes(self, form: str) -> int:
        """Return the length of a row on the line, with its terminator [bytes]."""
        return sum(part.size for part in self.row_parts(form)) + self._terminator_bytes(form)

    def event_bytes(self, form: str) -> int:
        """Return the length of an event message on the line, with its terminator [bytes]."""
        return sum(part.size for part in self.event_parts(form)) + self._terminator_bytes(form)

    def _templates(self, form: str) -> FrameTemplates:
        return self.binary if form == "binary" else self.ascii

    def _terminator_bytes(self, form: str) -> int:
        return 0 if form == "binary" else len(self.terminator)


def line_load(amplifier: AmplifierConfig, profile: AmplifierProfile, cycle_time_s: float) -> float:
    """Return the fraction of the serial line's capacity that a stream uses.

    It counts the rows and, if the SYNC pulse is wired to the trigger input, one event per cycle; a
    byte takes ten bits.
    """
    load_bit_s = BITS_PER_BYTE * (
        amplifier.rate_hz * profile.row_bytes(amplifier.format)
        + _event_bytes_s(amplifier, profile, cycle_time_s)
    )
    return load_bit_s / amplifier.baud_rate


def highest_rate_hz(
    amplifier: AmplifierConfig, profile: AmplifierProfile, cycle_time_s: float
) -> float:
    """Return the highest rate of rows that the line carries [1/s]; 0 if it carries none."""
    room = LINE_LOAD_LIMIT * amplifier.baud_rate / BITS_PER_BYTE
    room -= _event_bytes_s(amplifier, profile, cycle_time_s)
    return max(room / profile.row_bytes(amplifier.format), 0.0)


def require_line(
    amplifier: AmplifierConfig, profile: AmplifierProfile, cycle_time_s: float
) -> float:
    """Return the line's load; refuse a stream that cannot work.

    Raises:
        ConfigError: The stream uses more than `LINE_LOAD_LIMIT`; the text names a rate or baud rate
            that is possible.
    """
    load = line_load(amplifier, profile, cycle_time_s)
    if load <= LINE_LOAD_LIMIT:
        return load
    ways = []
    rate_hz = int(highest_rate_hz(amplifier, profile, cycle_time_s))
    if rate_hz >= 1:
        ways.append(f"rate_hz {rate_hz} at most")
    needed = load * amplifier.baud_rate / LINE_LOAD_LIMIT
    baud_rate = next((rate for rate in BAUD_RATES if rate >= needed), None)
    if baud_rate is not None:
        ways.append(f"baud_rate {baud_rate} at least")
    if amplifier.format == "ascii":
        binary = amplifier.model_copy(update={"format": "binary"})
        if line_load(binary, profile, cycle_time_s) <= LINE_LOAD_LIMIT:
            ways.append("format binary")
    possible = ", or ".join(ways) or "nothing on a serial line"
    raise ConfigError(
        f"{amplifier.rate_hz:g} rows/s of {profile.row_bytes(amplifier.format)} bytes take"
        f" {100.0 * load:.0f} % of a line at {amplifier.baud_rate} baud; at most"
        f" {100.0 * LINE_LOAD_LIMIT:.0f} % are allowed; possible: {possible}",
        code="RID-AMPLIFIER-LINE-LOAD",
    )


def _event_bytes_s(
    amplifier: AmplifierConfig, profile: AmplifierProfile, cycle_time_s: float
) -> float:
    return profile.event_bytes(amplifier.format) / cycle_time_s if amplifier.trigger else 0.0


def _parts(template: str, form: str, names: tuple[str, ...]) -> tuple[Part, ...]:
    """Return the parts of a template; raise ValueError if it is invalid."""
    parts: list[Part] = []
    position = 0
    for match in _PART.finditer(template):
        if match.start() != position:
            break
        position = match.end()
        parts.append(_part(match, form))
    if position != len(template):
        raise ValueError(f"{form}: cannot read {template[position:]!r} of {template!r}; correct it")
    found = [part.name for part in parts if part.kind != "literal"]
    if sorted(found) != sorted(names) or found[-1] != "checksum" or parts[-1].name != "checksum":
        raise ValueError(
            f"{form}: {template!r} must have each of {', '.join(names)} once, with the checksum at"
            " the end"
        )
    if parts[0].kind != "literal":
        raise ValueError(f"{form}: {template!r} must begin with a literal that marks its start")
    return tuple(parts)


def _part(match: re.Match[str], form: str) -> Part:
    literal = match["literal"]
    if literal is not None:
        try:
            data = bytes.fromhex(literal) if form == "binary" else literal.encode("ascii")
        except ValueError:
            raise ValueError(
                f"{form}: {literal!r} is not a literal: give"
                f" {'pairs of digits 0 to 9 and a to f' if form == 'binary' else 'ASCII text'}"
            ) from None
        return Part("", "literal", len(data), literal=data)
    name, kind, width = match["name"], match["kind"], int(match["width"])
    repeat = CHANNELS if name == "counts" else 1
    if form == "binary":
        if _BINARY_KINDS.get(name) != f"{kind}{width}":
            raise ValueError(
                f"binary: {name} is {kind}{width}; it must be {_BINARY_KINDS.get(name, 'left out')}"
            )
        return Part(name, "i" if kind == "i" else "u", width, repeat)
    if name == "counts":
        if kind != "dec" or width < 6:
            raise ValueError("ascii: counts must be dec6 or wider, for a sign and five digits")
        return Part(name, "dec", width, repeat)
    if kind != "hex" or _HEX_WIDTHS.get(name) != width:
        wanted = f"hex{_HEX_WIDTHS[name]}" if name in _HEX_WIDTHS else "left out"
        raise ValueError(f"ascii: {name} is {kind}{width}; it must be {wanted}")
    return Part(name, "hex", width, repeat)


def _refuse_twins(what: str, values: list[str] | list[int]) -> None:
    twins = sorted({str(value) for value in values if values.count(value) > 1})  # type: ignore[arg-type]
    if twins:
        raise ValueError(f"{what}: {', '.join(twins)} occurs twice; make it unique")
