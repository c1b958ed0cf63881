"""Simulated amplifier at a plain terminal: a person types, reads, and starts a stream.

The driver is not used: the port is opened like by any terminal program.
"""

from __future__ import annotations

import os
import re
import select
import termios
import time
import tty
from collections.abc import Callable
from typing import Any

from tests.builders.console_blocks import assert_shown

PATIENCE_S = 120.0
MINITERM = (
    "python -m serial.tools.miniterm --eol CR --echo /run/user/1000/rid-daq/ir361.plate 460800"
)
TYPED = (
    *("ID?", "RO?", "3:RG?", "RG2500", "3:RG1250", "3:RG?", "XX?", "9:RG?"),
    *("SE-7.5", "LP200", "SR2", "SF0", "RO1", "VA?", "OV?", "ST1"),
)


class Terminal:
    """A raw serial port, read line by line."""

    def __init__(self, path: str) -> None:
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._fd, termios.TCSANOW)
        speeds = termios.tcgetattr(self._fd)
        speeds[4] = speeds[5] = termios.B460800
        termios.tcsetattr(self._fd, termios.TCSANOW, speeds)
        self._text = b""

    def line(self) -> str:
        until_s = time.monotonic() + PATIENCE_S
        while b"\r" not in self._text:
            assert time.monotonic() < until_s, f"no answer, only {self._text!r}"
            if select.select([self._fd], [], [], 0.1)[0]:
                self._text += os.read(self._fd, 4096)
        line, _, self._text = self._text.partition(b"\r")
        return line.decode("ascii").lstrip("\n")

    def say(self, text: str) -> None:
        os.write(self._fd, text.encode() + b"\r")

    def ask(self, text: str) -> str:
        self.say(text)
        return self.line()

    def close(self) -> None:
        os.close(self._fd)


def test_a_person_at_a_terminal_can_operate_the_amplifier(
    serve_amplifier: Callable[..., Any],
) -> None:
    terminal = Terminal(serve_amplifier().address)
    try:
        assert "simulated" in terminal.ask("ID?")
        assert terminal.ask("RO?") == "0"
        assert terminal.ask("RO1") == "OK"
        assert terminal.ask("RO?") == "1"
        assert terminal.ask("3:RG2500") == "OK,CL"  # a changed range clears the charge
        assert terminal.ask("3:RG?") == "2500"
        forces = terminal.ask("VA?").split(",")
        assert len(forces) == 8
        assert all(abs(float(force)) < 50.0 for force in forces)
        assert terminal.ask("OV?") == "00"
        assert terminal.ask("nonsense") == "E01"
        assert terminal.ask("SF0") == "OK"
        assert terminal.ask("ST1") == "OK"
        rows = [terminal.line() for _ in range(20)]
        assert all(re.fullmatch(r"#[0-9A-F]{4},[0-9A-F]{8},.*\*[0-9A-F]{4}", row) for row in rows)
        numbers = [int(row[1:5], 16) for row in rows]
        assert numbers == list(range(numbers[0], numbers[0] + 20))
    finally:
        terminal.close()


def test_the_dialog_of_the_guide(serve_amplifier: Callable[..., Any]) -> None:
    amplifier = serve_amplifier()
    amplifier.stream_s = 5.0
    terminal = Terminal(amplifier.address)
    shown = []
    try:
        for typed in TYPED:
            shown += [typed, terminal.ask(typed)]
        shown += [terminal.line() for _ in range(5)]
        for typed, reply in (("TM?", "!04"), ("ST0", "OK"), ("RO0", "OK")):
            terminal.say(typed)
            shown += [typed, terminal.line()]
            while not shown[-1].startswith(reply):
                shown.append(terminal.line())
    finally:
        terminal.close()
    assert_shown("force-plate", MINITERM, "\n".join(shown), same_numbers=False)
