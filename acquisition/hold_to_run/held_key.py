"""`HeldKey`: decides which key counts as held, from messages that may be late, lost or repeated.

A message counts by the age of the challenge that it answers, so a delay on any way between the
person and this class shortens the time that a key counts, and never extends it. Time is an
argument.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Final, NamedTuple, Self

from acquisition.hold_to_run.dead_man import DEAD_MAN_S

CHALLENGE_LIMIT_S: Final = 0.3
"""Age from which an answered challenge is too old [s]; no key counts as held beyond it."""

LONGEST_KEY: Final = 8
"""Most characters of a key's name."""

LARGEST_SEQUENCE: Final = 2**53
"""Largest sequence number: JavaScript's integers are exact below it."""


class Held(NamedTuple):
    """A key that is held.

    Attributes:
        key: Its name.
        press: The number of the press: another one after every release.
        until_s: When it no longer counts as held, by `safety_now_s` [s].
    """

    key: str
    press: int
    until_s: float


@dataclass(frozen=True)
class KeyMessage:
    """One message about a key, as the service passes it on to the worker.

    Attributes:
        key: The key; empty if none is held any more.
        tapped: True for a key that was tapped, False for one that is held.
        sender: The connection and lease that it came by.
        sequence: The sender's number of this message.
        issued_s: When the service issued the challenge that it answers, by `safety_now_s` [s]; 0 if
            the service did not issue it to this sender for this job.
    """

    key: str
    tapped: bool
    sender: str
    sequence: int
    issued_s: float

    @property
    def is_release(self) -> bool:
        """Whether it says that no key is held any more."""
        return not (self.tapped or self.key)

    def order(self) -> dict[str, Any]:
        """Return the message as JSON has it."""
        return {
            "tapped" if self.tapped else "held": self.key,
            "sender": self.sender,
            "sequence": self.sequence,
            "issued_s": self.issued_s,
        }

    @classmethod
    def of(cls, order: object) -> Self | None:
        """Return the message of an order; None if it is no complete message about a key."""
        match order:
            case {"held": str(key), "sender": sender, "sequence": sequence, "issued_s": issued_s}:
                tapped = False
            case {"tapped": str(key), "sender": sender, "sequence": sequence, "issued_s": issued_s}:
                tapped = True
            case _:
                return None
        if not (isinstance(sender, str) and isinstance(issued_s, float)):
            return None
        if type(sequence) is not int or not 0 <= sequence < LARGEST_SEQUENCE:
            return None
        if len(key) > LONGEST_KEY or (tapped and not key):
            return None
        return cls(key, tapped, sender, sequence, issued_s)


class KeyVerdict(Enum):
    """What became of a message."""

    COUNTS = auto()
    IGNORED = auto()
    """A repeat, one that was overtaken, or one that nobody asked for."""
    LATE = auto()
    """Its challenge is too old: the press is over, or the tap is lost."""
    UNRELEASED = auto()
    """Its press has ended, or did not count from its beginning: only another press counts."""
    ELSEWHERE = auto()
    """Another sender holds a key."""
    TAP_LOST = auto()
    """A tap of this sender was late: what it has chosen is not what it believes."""


@dataclass
class _Sender:
    """What is known of a sender.

    Attributes:
        sequence: Its latest number.
        released: True if it may begin a press: since its last press it has said that no key is
            held.
        tap_lost: True if its latest tap was late.
    """

    sequence: int
    released: bool
    tap_lost: bool = False


class HeldKey:
    """The one key that is held, of all that several senders say.

    A press begins with a fresh message of a sender that has released its key before. It lasts as
    long as further messages of that sender arrive within `DEAD_MAN_S`, with rising sequence numbers
    and with challenges younger than `CHALLENGE_LIMIT_S`. After a gap only a release and another
    press count. A sender that is new while another has not released its key must release first: it
    may be the same key over another connection.
    """

    def __init__(self) -> None:
        self._senders: dict[str, _Sender] = {}
        self._asked = False
        self._presses = 0
        self._held: Held | None = None
        self._sender = ""  # of the latest press
        self._issued_s = 0.0  # of the newest challenge that counted

    def ask(self, asked: bool) -> None:
        """Begin or end the time in which keys count; a key that is held across it does not."""
        self._asked = asked
        self._held = None

    def held(self, now_s: float) -> Held | None:
        """Return the key that is held, None if there is none."""
        return self._held if self._held is not None and now_s < self._held.until_s else None

    def end_gap(self, now_s: float) -> float | None:
        """End a press whose messages have stopped.

        Returns:
            The age of the newest challenge that was answered [s]; None if there was no such press.
        """
        if self._held is None or now_s < self._held.until_s:
            return None
        self._held = None
        return now_s - self._issued_s

    def take(self, message: KeyMessage, now_s: float) -> KeyVerdict:
        """Take a message, and return what became of it.

        Args:
            now_s: Now, by `safety_now_s` [s].
        """
        self.end_gap(now_s)
        sender = self._senders.get(message.sender)
        if sender is None:
            let_go = all(each.released for each in self._senders.values())
            sender = self._senders[message.sender] = _Sender(-1, let_go)
        if message.sequence <= sender.sequence:
            return KeyVerdict.IGNORED
        sender.sequence = message.sequence
        fresh = 0.0 <= now_s - message.issued_s < CHALLENGE_LIMIT_S
        if message.tapped:
            sender.tap_lost = not fresh
            return KeyVerdict.COUNTS if fresh else KeyVerdict.LATE
        ours = message.sender == self._sender
        if message.is_release:
            sender.released = True
            if ours:
                self._held = None
            return KeyVerdict.COUNTS
        verdict = self._judge(message, sender, fresh=fresh)
        if verdict is KeyVerdict.COUNTS:
            self._go_on(message, now_s)
        elif ours:
            self._held = None
        sender.released = False
        return verdict

    def _judge(self, message: KeyMessage, sender: _Sender, *, fresh: bool) -> KeyVerdict:
        if not self._asked:
            return KeyVerdict.IGNORED
        if not fresh:
            return KeyVerdict.LATE
        if sender.tap_lost:
            return KeyVerdict.TAP_LOST
        held = self._held
        if held is not None and message.sender != self._sender:
            return KeyVerdict.ELSEWHERE
        going_on = held is not None and held.key == message.key
        return KeyVerdict.COUNTS if going_on or sender.released else KeyVerdict.UNRELEASED

    def _go_on(self, message: KeyMessage, now_s: float) -> None:
        """Let a press go on, or begin one."""
        until_s = min(message.issued_s + CHALLENGE_LIMIT_S, now_s + DEAD_MAN_S)
        if self._held is None:
            self._presses += 1
            self._sender = message.sender
            self._issued_s = message.issued_s
            self._held = Held(message.key, self._presses, until_s)
        else:
            self._issued_s = max(self._issued_s, message.issued_s)
            self._held = self._held._replace(until_s=max(self._held.until_s, until_s))
