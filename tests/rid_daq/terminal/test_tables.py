"""Tables on a terminal: complete headings and values, in parts if the terminal is narrow."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rid_daq.terminal.console import Console
from rid_daq.terminal.tables import layout_parts
from tests.builders.screens import terminal

NUMBERS = [f"{1000.0 * number:.1f}" for number in range(1, 11)]


def lines(columns: int, head: list[str], rows: list[list[str]], key: int = 1) -> list[str]:
    with terminal(columns) as shown:
        Console().table(head, rows, key=key)
    text = shown.getvalue()
    for style in ("\x1b[1m", "\x1b[0m", "\x1b[31m"):
        text = text.replace(style, "")
    return [line.rstrip() for line in text.splitlines()]


def test_units_in_brackets_stay_in_the_head() -> None:
    shown = lines(80, ["axis", "delay [ms]", "mean [mm]"], [["axis1", "0.5", "2"]])
    assert shown[0] == "axis   delay [ms]  mean [mm]"


def test_numbers_are_not_wrapped_and_texts_are_wrapped_at_words() -> None:
    head = ["axis", "acceleration", "what was found", *["torque"] * 5]
    rows = [["axis1", "0.0318 rad/s", "a sentence of some length", *["12.5 N m"] * 5]]
    shown = lines(80, head, rows)
    assert max(map(len, shown)) <= 80
    (row,) = [line for line in shown if "0.0318 rad/s" in line]
    assert row.count("12.5 N m") == 5
    assert "acceleration" in " ".join(shown)


@pytest.mark.parametrize(("columns", "parts"), [(110, 1), (80, 2), (50, 4)])
def test_a_wide_table_is_split_into_parts_that_repeat_the_row_key(columns: int, parts: int) -> None:
    head = ["", "wrong", *[f"n{number}" for number in range(1, 11)]]
    shown = lines(columns, head, [["1", "torque constant", *NUMBERS]], key=2)
    assert max(map(len, shown)) <= columns
    assert len([line for line in shown if "wrong" in line]) == parts
    assert len([line for line in shown if line.startswith("1  torque")]) == parts
    assert sorted(word for line in shown for word in line.split() if "." in word) == sorted(NUMBERS)


@given(
    table=st.integers(2, 6).flatmap(
        lambda width: st.lists(
            st.lists(
                st.text("ab \u4e2d1.", max_size=30).map(str.strip), min_size=width, max_size=width
            ),
            min_size=1,
            max_size=4,
        )
    ),
    columns=st.integers(20, 130),
    key=st.integers(1, 2),
)
def test_every_column_is_shown_once_and_every_part_fits(
    table: list[list[str]], columns: int, key: int
) -> None:
    parts = layout_parts(table, columns, key)
    if parts is None:
        return
    kept = [number for part in parts for number, _ in part]
    assert set(kept) == set(range(len(table[0])))
    assert all(kept.count(number) == 1 for number in range(key, len(table[0])))
    for part in parts:
        assert sum(width for _, width in part) + 2 * (len(part) - 1) <= columns
