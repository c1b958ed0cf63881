"""`LawicelAdapter`: the adapter's side of LAWICEL's ASCII protocol ("slcan").

The commands are those of LAWICEL's CANUSB manual: S and s set the bit rate; O and L open the
channel, C closes it; t, T, r and R transmit a frame; F, V and N are queries; Z switches time stamps
on or off; M and m set filters, which have no effect here. Each command and each answer ends with
CR, but the answer to a refused command is BELL. Frames from the bus have the format of the transmit
commands.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from mock_hw.bus.wire_time import EXTENDED_FLAG, EXTENDED_MASK, REMOTE_FLAG, STANDARD_MASK

OK, REFUSED = b"\r", b"\a"
BIT_RATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
VERSION, SERIAL_NUMBER = b"V1013\r", b"NA123\r"
OVERRUN = 0x08

_LONGEST_COMMAND = 27  # Tiiiiiiiildd..., without CR
_TRANSMIT = re.compile(
    rb"(?:t([0-7][0-9A-F]{2})|T([01][0-9A-F]{7}))([0-8])((?:[0-9A-F]{2}){0,8})"
    rb"|(?:r([0-7][0-9A-F]{2})|R([01][0-9A-F]{7}))([0-8])",
    re.IGNORECASE,
)
_SETTINGS = re.compile(rb"s[0-9A-F]{4}|[Mm][0-9A-F]{8}", re.IGNORECASE)


class AdapterFrame(NamedTuple):
    """A frame on the adapter's bus; `can_id` contains the flags of SocketCAN."""

    can_id: int
    length: int
    data: bytes


class LawicelAdapter:
    """A simulated adapter on a bus with a fixed bit rate.

    Args:
        bit_rate: Bit rate of the bus [bit/s]. If the adapter is opened with another bit rate, it
            receives and sends nothing.
        now_ms: Function that returns the time for the time stamps of received frames [ms].

    Attributes:
        open: True if the channel is open.
        overrun: True if bytes for the computer were lost; the command F reports and clears this
            flag.
    """

    def __init__(self, bit_rate: int, now_ms: Callable[[], int]) -> None:
        self._bus_rate = bit_rate
        self._now_ms = now_ms
        self._rate: int | None = None
        self._pending = bytearray()
        self._stamps = False
        self._listen_only = False
        self.open = False
        self.overrun = False

    def feed(self, data: bytes) -> tuple[bytes, list[AdapterFrame]]:
        """Process bytes from the computer; return the answers, and the frames for the bus."""
        answers = bytearray()
        frames: list[AdapterFrame] = []
        *commands, rest = (self._pending + data).split(b"\r")
        self._pending = rest[: _LONGEST_COMMAND + 1]
        for command in commands:
            answers += self._obey(bytes(command), frames)
        return bytes(answers), frames

    def encode(self, frame: AdapterFrame) -> bytes:
        """Return the bytes of a bus frame for the computer; empty if the channel is closed."""
        if not (self.open and self._rate == self._bus_rate):
            return b""
        letter, number = "t", f"{frame.can_id & STANDARD_MASK:03X}"
        if frame.can_id & EXTENDED_FLAG:
            letter, number = "T", f"{frame.can_id & EXTENDED_MASK:08X}"
        data = frame.data[: frame.length].hex().upper()
        if frame.can_id & REMOTE_FLAG:
            letter, data = {"t": "r", "T": "R"}[letter], ""
        stamp = f"{self._now_ms() % 60_000:04X}" if self._stamps else ""
        return f"{letter}{number}{frame.length}{data}{stamp}\r".encode()

    def _obey(self, command: bytes, frames: list[AdapterFrame]) -> bytes:
        if not command:
            return OK
        letter = command[:1]
        if letter in b"tTrR":
            return self._transmit(command, frames)
        if command in (b"V", b"N"):
            return VERSION if command == b"V" else SERIAL_NUMBER
        if command == b"F":
            flags, self.overrun = OVERRUN if self.overrun else 0, False
            return b"F%02X\r" % flags if self.open else REFUSED
        if command == b"C":
            was_open, self.open = self.open, False
            return OK if was_open else REFUSED
        return OK if not self.open and self._set_up(command) else REFUSED

    def _set_up(self, command: bytes) -> bool:
        """Execute a command that requires a closed channel; return True if it was valid."""
        if command in (b"O", b"L"):
            if self._rate is None:
                return False
            self.open = True
            self._listen_only = command == b"L"
        elif command[:1] == b"S" and command[1:] in b"012345678" and len(command) == 2:
            self._rate = BIT_RATES[int(command[1:])]
        elif command in (b"Z0", b"Z1"):
            self._stamps = command == b"Z1"
        elif not _SETTINGS.fullmatch(command):
            return False
        elif command[:1] == b"s":
            self._rate = self._bus_rate  # its bit-timing registers are not simulated
        return True

    def _transmit(self, command: bytes, frames: list[AdapterFrame]) -> bytes:
        match = _TRANSMIT.fullmatch(command)
        if match is None or not self.open or self._listen_only:
            return REFUSED
        standard, extended, length, data, remote, remote_extended, remote_length = match.groups()
        if (remote or remote_extended) is not None:
            can_id, size, payload = REMOTE_FLAG, int(remote_length), b""
            standard, extended = remote, remote_extended
        else:
            can_id, size, payload = 0, int(length), bytes.fromhex(data.decode())
            if len(payload) != size:
                return REFUSED
        can_id |= int(standard, 16) if standard else int(extended, 16) | EXTENDED_FLAG
        if self._rate == self._bus_rate:
            frames.append(AdapterFrame(can_id, size, payload))
        return b"z\r" if standard else b"Z\r"
