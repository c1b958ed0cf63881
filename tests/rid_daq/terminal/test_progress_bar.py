from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from identification.design.criteria import Condition, Criterion, DOptimal, Goals
from rid_daq.terminal.progress_bar import BAR, ProgressBar, bar_line, shorten

TAIL = (
    "transient period; torque 28% (axis2), following error 1.4% (axis3) of the limit; mass 2.80 kg"
)


@pytest.mark.parametrize(
    ("width", "tail"),
    [
        (80, "transient period; torque 28%"),
        (120, "transient period; torque 28% (axis2), following error 1.4%"),
        (200, TAIL),
    ],
)
def test_the_tail_is_shortened_before_bar_count_and_remaining_time(width: int, tail: str) -> None:
    line = bar_line(width, "measurement", "1.1/3.5 periods", TAIL)
    assert line.title == "measurement"
    assert line.tail == tail
    assert BAR[0] <= line.bar <= BAR[1]
    used = len(line.title) + line.bar + len("1.1/3.5 periods") + len("99:59:59") + len(tail) + 4
    assert used <= width


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize("title", ["recording", "the unloaded robot, before the payload is hung"])
def test_a_terminal_shows_bar_count_and_remaining_time_on_one_line(width: int, title: str) -> None:
    file = io.StringIO()
    console = Console(file=file, width=width, force_terminal=True, color_system=None)
    bar = ProgressBar(title, 36.0, "periods", console)
    with bar.shown():
        bar.update(12.5, TAIL)
    last = [line for line in file.getvalue().splitlines() if "periods" in line][-1]
    assert "12/36 periods -:--:-- transient period" in last
    assert "━━━" in last  # the completed part of the bar
    assert "…" not in last.split("36 periods")[1]


@pytest.mark.parametrize("criterion", [DOptimal(), Condition(), Goals(np.eye(1))])
def test_the_best_value_of_a_design_is_complete_at_80_columns(criterion: Criterion) -> None:
    best = f"best {criterion.describe(-12345.678)}"
    line = bar_line(80, "Designing", "12/12 starts", best)
    assert line.tail == best.split(" (")[0]
    assert line.bar >= BAR[0]


def test_a_text_that_cannot_be_split_is_shortened_with_dots() -> None:
    assert shorten("abcdefgh", 5) == "abcd…"
    assert shorten("abcdefgh", 8) == "abcdefgh"
    assert shorten("measuring; torque", 12) == "measuring"
    assert shorten("abcdefgh", 0) == ""
