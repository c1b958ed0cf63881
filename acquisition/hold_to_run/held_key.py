"""`HeldKey`: decides if a key counts as held; its messages may be late, lost or repeated.

Each message answers a challenge of the service and is valid according to the age of that challenge.
Therefore, whatever the delays, a key counts as held for at most `CHALLENGE_LIMIT_S` after the
service issued the newest challenge that was answered. The present time is an argument of the
methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Final, NamedTuple, Self

from acquisition.hold_to_run.dead_man import DEAD_MAN_S

CHALLENGE_LIMIT_S: Final = 0.3
"""Age [s] above which an answered challenge is too old, so that the key no longer counts as
held."""

LONGEST_KEY: Final = 8
"""Maximum length of a key's name."""

LARGEST_SEQUENCE: Final = 2**53
"""Sequence numbers must be below this: JavaScript's integers are exact there."""


class KeyPress(NamedTuple):
    """A key that is held.

    Attributes:
        key: Name of the key.
        press: Number of the press; it increases with each press after a release.
        until_s: Time from which the key no longer counts as held, on the clock of `safety_now_s`
            [s].
    """

    key: str
    press: int
    until_s: float


@dataclass(frozen=True)
class KeyMessage:
    """One message about a key, as the service sends it to the worker.

    Attributes:
        key: Name of the key; empty if no key is held any more.
        tapped: True for a key that was tapped, False for a key that is held or released.
        sender: Connection and lease that sent the message.
        sequence: Number of this message, counted by the sender.
        issued_s: Time at which the service issued the challenge that the message answers, on the
            clock of `safety_now_s` [s]; 0 if the service did not issue it to this sender for this
            job.
    """

    key: str
    tapped: bool
    sender: str
    sequence: int
    issued_s: float

    @property
    def is_release(self) -> bool:
        """True if the message says that no key is held any more."""
        return not (self.tapped or self.key)

    def to_order(self) -> dict[str, Any]:
        """Return the message as a JSON object."""
        return {
            "tapped" if self.tapped else "held": self.key,
            "sender": self.sender,
            "sequence": self.sequence,
            "issued_s": self.issued_s,
        }

    @classmethod
    def from_order(cls, order: object) -> Self | None:
        """Return the message in a JSON object; None if it is not a valid message about a key."""
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
    """Result of the judgement of a key message."""

    COUNTS = auto()
    IGNORED = auto()
    """The message is a repeat, or a later one arrived before it, or held keys do not count now."""
    LATE = auto()
    """The challenge of the message is too old: the press has ended, or the tap is lost."""
    UNRELEASED = auto()
    """The press of the held key has ended, or never counted: release the key and press again."""
    ELSEWHERE = auto()
    """Another sender holds a key."""
    TAP_LOST = auto()
    """An earlier tap of this sender was late and ignored: its page shows a selection that was not
    made."""


@dataclass
class _Sender:
    """State of a sender.

    Attributes:
        sequence: Number of its latest message.
        released: True if the sender may begin a press: since its last press, it has reported that
            no key is held.
        tap_lost: True if its latest tap was late.
    """

    sequence: int
    released: bool
    tap_lost: bool = False


class HeldKey:
    """The key that is held, at most one, according to the messages of several senders.

    - A press begins with a message that answers a recent challenge, from a sender that has released
      its key before.
    - The press continues while further messages of this sender arrive within `DEAD_MAN_S`, with
      increasing sequence numbers and with challenges younger than `CHALLENGE_LIMIT_S`.
    - After a gap, only a release followed by a new press counts.
    - While any sender has not released its key, a new sender must first report that no key is held:
      both may be the same key over two connections.
    """

    def __init__(self) -> None:
        self._senders: dict[str, _Sender] = {}
        self._accepting = False
        self._presses = 0
        self._held: KeyPress | None = None
        self._sender = ""  # sender of the latest press
        self._issued_s = 0.0  # issue time of the newest accepted challenge

    def set_accepting(self, accepting: bool) -> None:
        """Begin or end the time in which keys count; a key that is already held does not count."""
        self._accepting = accepting
        self._held = None

    def held(self, now_s: float) -> KeyPress | None:
        """Return the held key; None if no key is held."""
        return self._held if self._held is not None and now_s < self._held.until_s else None

    def end_expired_press(self, now_s: float) -> float | None:
        """End a press whose messages have stopped.

        Returns:
            Age of the newest answered challenge [s]; None if no press was ended.
        """
        if self._held is None or now_s < self._held.until_s:
            return None
        self._held = None
        return now_s - self._issued_s

    def process(self, message: KeyMessage, now_s: float) -> KeyVerdict:
        """Process a message and return the verdict.

        Args:
            now_s: Present time, on the clock of `safety_now_s` [s].
        """
        self.end_expired_press(now_s)
        sender = self._senders.get(message.sender)
        if sender is None:
            all_released = all(each.released for each in self._senders.values())
            sender = self._senders[message.sender] = _Sender(-1, all_released)
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
            self._extend_or_begin(message, now_s)
        elif ours:
            self._held = None
        sender.released = False
        return verdict

    def _judge(self, message: KeyMessage, sender: _Sender, *, fresh: bool) -> KeyVerdict:
        if not self._accepting:
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

    def _extend_or_begin(self, message: KeyMessage, now_s: float) -> None:
        """Extend the present press, or begin a new one."""
        until_s = min(message.issued_s + CHALLENGE_LIMIT_S, now_s + DEAD_MAN_S)
        if self._held is None:
            self._presses += 1
            self._sender = message.sender
            self._issued_s = message.issued_s
            self._held = KeyPress(message.key, self._presses, until_s)
        else:
            self._issued_s = max(self._issued_s, message.issued_s)
            self._held = self._held._replace(until_s=max(self._held.until_s, until_s))
