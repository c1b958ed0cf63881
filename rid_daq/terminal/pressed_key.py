"""`read_key`: reads one key of a terminal as soon as it is pressed."""

from __future__ import annotations

import os
import sys
import termios
import tty


def read_key() -> str:
    """Return the next pressed key without showing it; empty at the end of the input."""
    stdin = sys.stdin.fileno()
    before = termios.tcgetattr(stdin)
    tty.setcbreak(stdin, termios.TCSANOW)  # keep a key that was already pressed
    try:
        return os.read(stdin, 1).decode("ascii", "replace")
    finally:
        termios.tcsetattr(stdin, termios.TCSADRAIN, before)
