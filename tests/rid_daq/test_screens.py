"""Help and output of commands fit the terminal at 80 and 120 columns."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.cells import cell_len

from rid_daq.command_line.root import COMMANDS
from tests.builders.screens import (
    THEMES,
    WIDTHS,
    help_screens,
    main_commands,
    require_fitting,
    store_screen,
    too_wide,
)


@pytest.mark.parametrize("columns", WIDTHS)
def test_the_help_of_every_command_fits(columns: int) -> None:
    screens = help_screens(columns)
    assert {screen.words[0] for screen in screens} == {*COMMANDS, "--help"}
    for screen in screens:
        store_screen(screen, "help")
        assert too_wide(screen.lines, columns) == [], screen.words
        assert len(screen.lines) > 5
        assert not [line for line in screen.lines[1:] if " range>" in line or line.endswith("...")]
    widest = max(cell_len(line) for screen in screens for line in screen.lines)
    assert widest > columns - 5  # the available width is used


def test_a_screen_is_written_as_a_picture_in_both_themes() -> None:
    screen = next(each for each in help_screens(80) if each.words == ("stop", "--help"))
    light, dark = (screen.svg(theme) for theme in THEMES.values())
    assert light.startswith("<svg")
    assert "quick" in light
    assert light != dark


@pytest.mark.long
@pytest.mark.usefixtures("plain_reports")
def test_the_output_of_commands_on_a_simulated_cell_fits(tmp_path: Path) -> None:
    count = 0
    for count, (words, calls) in enumerate(main_commands(tmp_path), start=1):
        require_fitting(words, calls, f"{count:02d}")
    assert count >= 25
