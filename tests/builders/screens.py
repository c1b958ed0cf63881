"""Screens: terminal output of commands, as lines and as SVG in a light and a dark theme.

`python -m tests.builders.screens FOLDER` writes the help of every command and the output of the
main commands on a simulated cell, at 80 and at 120 columns.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from rich.cells import cell_len
from rich.console import Console as RichConsole
from rich.terminal_theme import DEFAULT_TERMINAL_THEME, MONOKAI, TerminalTheme
from rich.text import Text

from rid_daq.app import run
from rid_daq.command_line.root import COMMANDS, command_words
from rid_daq.terminal.console import Console
from tests.builders.identified_run import friction_run
from tests.builders.motion_texts import PICK

WIDTHS: Final = (80, 120)
THEMES: Final[dict[str, TerminalTheme]] = {"light": DEFAULT_TERMINAL_THEME, "dark": MONOKAI}
TITLE: Final = 50  # characters
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_UP = re.compile(r"\x1b\[(\d*)A")
_CLEARED, _CURSOR = "\x1b[2K", ("\x1b[?25l", "\x1b[?25h")
_TOKENS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|[\r\n]|[^\x1b\r\n]+")


@dataclass(frozen=True)
class Screen:
    """Terminal output of one command at one width.

    Attributes:
        words: Command line without the program's name.
        columns: Width of the terminal.
        text: Output with colours.
    """

    words: tuple[str, ...]
    columns: int
    text: str

    @property
    def lines(self) -> list[str]:
        """The lines without colours."""
        return screen_lines(self.text)

    def svg(self, theme: TerminalTheme) -> str:
        drawn = RichConsole(
            record=True, width=self.columns, file=io.StringIO(), force_terminal=True, height=100
        )
        drawn.print(Text.from_ansi(final_content(self.text).rstrip()))
        named = [word for word in self.words if "/" not in word]
        return drawn.export_svg(title=f"rid-daq {' '.join(named)}"[:TITLE], theme=theme)

    def write(self, folder: Path) -> None:
        """Write the picture in both themes."""
        folder.mkdir(parents=True, exist_ok=True)
        name = "-".join(word.strip("-") for word in self.words if "/" not in word) or "rid-daq"
        for theme, colours in THEMES.items():
            path = folder / f"{name[:60]}-{self.columns}-{theme}.svg"
            path.write_text(self.svg(colours), encoding="utf-8")


def final_content(written: str) -> str:
    """Return the final content of a terminal after some output, with colours.

    Lines that a progress bar has rewritten occur once.
    """
    lines, row = [""], 0
    for token in _TOKENS.findall(written):
        if token == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        elif token == _CLEARED:
            lines[row] = ""
        elif up := _UP.fullmatch(token):
            row = max(0, row - int(up[1] or 1))
        elif token not in ("\r", *_CURSOR):
            lines[row] += token
    return "\n".join(lines)


def screen_lines(written: str) -> list[str]:
    """Return the final lines of a terminal, without colours."""
    return _COLOUR.sub("", final_content(written)).rstrip("\n").split("\n")


@contextlib.contextmanager
def terminal(columns: int) -> Iterator[io.StringIO]:
    """Redirect stdout to a terminal of `columns` columns with colours, and yield it."""
    size = {"COLUMNS": str(columns), "LINES": "100", "FORCE_COLOR": "1", "TERM": "xterm-256color"}
    shown = io.StringIO()
    with (
        patch.dict(os.environ, size),
        patch.object(Console, "is_terminal", True),
        contextlib.redirect_stdout(shown),
    ):
        os.environ.pop("NO_COLOR", None)
        yield shown


def command_lines() -> list[tuple[str, ...]]:
    """Return the program without a command, every command, and every command of a group."""
    return list(dict.fromkeys([(), *((name,) for name in COMMANDS), *command_words()]))


def help_screens(columns: int) -> list[Screen]:
    screens = []
    for words in command_lines():
        with terminal(columns) as shown:
            assert run([*words, "--help"]) == 0
        screens.append(Screen((*words, "--help"), columns, shown.getvalue()))
    return screens


Call = Callable[[Console], None]


@contextlib.contextmanager
def recorded_calls() -> Iterator[list[Call]]:
    """Yield the console calls of commands, to repeat them at any width.

    Nothing is shown, except the output of `--json`.
    """
    calls: list[Call] = []

    def noting(name: str) -> Callable[..., None]:
        def note(_console: Console, *arguments: Any, **named: Any) -> None:
            calls.append(lambda again: getattr(again, name)(*arguments, **named))

        return note

    with contextlib.ExitStack() as stack:
        for name in ("say", "verdict", "table"):
            stack.enter_context(patch.object(Console, name, noting(name)))
        yield calls


def calls_of_command(words: Sequence[str], codes: Sequence[int] = (0,)) -> list[Call]:
    """Run a command; return its calls of the console, which can be repeated at any width."""
    with recorded_calls() as calls, contextlib.redirect_stdout(io.StringIO()):
        code = run(list(words))
    assert code in codes, (words, code)
    return calls


def both_outputs(words: Sequence[str], codes: Sequence[int] = (0,)) -> tuple[Any, str]:
    """Run a command once; return its document and the text that it shows without `--json`.

    The text has no lines of progress.
    """
    printed, shown = io.StringIO(), io.StringIO()
    with recorded_calls() as calls, contextlib.redirect_stdout(printed):
        code = run([*words, "--json"])
    assert code in codes, (words, code)
    with contextlib.redirect_stdout(shown):
        for call in calls:
            call(Console())
    return json.loads(printed.getvalue()), shown.getvalue()


def store_screen(screen: Screen, folder: str) -> None:
    """Write a screen next to the screenshots of pages, if screenshots are requested."""
    if "RID_DAQ_SCREENSHOTS" in os.environ:
        screen.write(Path(os.environ["RID_DAQ_SCREENSHOTS"]) / "terminal" / folder)


def require_fitting(words: Sequence[str], calls: Sequence[Call], folder: str = "more") -> None:
    """Store the screens of a command, and require that its lines fit the width.

    The lines that `too_wide` excepts may be longer.
    """
    for columns in WIDTHS:
        screen = replay(words, calls, columns)
        store_screen(screen, folder)
        assert screen.lines, words
        assert too_wide(screen.lines, columns) == [], words


def too_wide(lines: list[str], columns: int) -> list[str]:
    """Return lines that are wider than the terminal.

    Lines that begin with `rid-daq` or end with an absolute path are excepted.
    """
    return [
        line
        for line in lines
        if cell_len(line) > columns
        and not line.strip().startswith("rid-daq ")
        and not line.split()[-1].startswith("/")
    ]


def replay(words: Sequence[str], calls: Sequence[Call], columns: int) -> Screen:
    """Return the screen of a command from its console calls; `runs` is run again."""
    with terminal(columns) as shown:
        if words[0] == "runs":
            run(list(words))
        else:
            for call in calls:
                call(Console())
    return Screen(tuple(words), columns, shown.getvalue())


def main_commands(folder: Path) -> Iterator[tuple[list[str], list[Call]]]:
    """Run the main commands on the small simulated cell; yield their words and console calls."""
    runs, motion = ["--runs", str(folder / "runs")], str(folder / "motion.yaml")
    small = ["--method", "two-harmonic", "--tries", "3", "--period", "4", "--periods", "3"]
    model = str(folder / "model.json")
    path = str(folder / "path.yaml")
    Path(path).write_text(PICK, encoding="utf-8")
    friction_run(folder / "runs", "there and back", 1)
    for words in (
        ["init", str(folder / "mine")],
        ["check", "ir361", "--seconds", "0.1", *runs],
        ["check", "ir361", "--seconds", "0.1", "--all", *runs],
        ["design", "ir361", "-o", motion, *small],
        ["record", "ir361", motion, "--label", "first", *runs],
        ["record", "ir361", motion, "--label", "second", "--seed", "2", *runs],
        ["average", "first", *runs],
        ["identify", "first", "-o", model, "--no-diagnose", *runs],
        ["validate", model, "second", *runs],
        ["identify", "second", "--no-diagnose", *runs],
        ["compare", model, "second", *runs],
        ["retime", "ir361", path, "--model", model, "-o", str(folder / "fast.yaml")],
        ["design", "ir361", "--kind", "multisine", "-o", str(folder / "multisine.yaml")],
        ["design", "ir361", "--kind", "constant-velocity", "-o", str(folder / "steady.yaml")],
        ["sensitivity", "kr15", "--payload", "medium", "--draws", "500"],
        ["tracking", "second", "--against", "first", *runs],
        ["friction", "there and back", "--model", model, *runs],
        ["report", "there and back", *runs],
        ["reset", "ir361"],
        ["drives", "backup", "ir361", "-o", str(folder / "drives.json")],
        ["export", "second", "--to", "csv", "-o", str(folder / "second.csv"), *runs],
        ["export", model, "--to", "urdf", "-o", str(folder / "robot.urdf"), *runs],
        ["runs", *runs],
        ["runs", "--verify", *runs],
        ["recover", "first", *runs],
    ):
        yield words, calls_of_command(words, (0, 1, 6))


def main(folder: Path) -> None:
    """Write all screens."""
    for columns in WIDTHS:
        for screen in help_screens(columns):
            screen.write(folder / "help")
    with tempfile.TemporaryDirectory(prefix="rid-screens-") as name:
        for number, (words, calls) in enumerate(main_commands(Path(name)), start=1):
            for columns in WIDTHS:
                replay(words, calls, columns).write(folder / f"{number:02d}")
    sys.stdout.write(f"{len(list(folder.rglob('*.svg')))} screens in {folder}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
