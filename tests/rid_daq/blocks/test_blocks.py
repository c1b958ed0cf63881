"""Blocks: content of tables and plots, and its complete output by every renderer."""

from __future__ import annotations

import json
import re
from typing import Any, get_args

import pytest
from pydantic import TypeAdapter, ValidationError

from rid_daq.blocks.block import (
    AnyBlock,
    Column,
    Heading,
    Interval,
    Next,
    Table,
    Text,
    Verdict,
)
from rid_daq.blocks.plot import Axis, Bar, Colour, Line, Panel, Plot
from rid_daq.blocks.plot import Span as Stretch
from rid_daq.figures.figure_item import figure_item
from rid_daq.report_page.drawings.page_colours import colours
from rid_daq.report_page.drawings.plot import plot_svg
from rid_daq.terminal.block_printer import print_blocks
from rid_daq.terminal.console import Console

TIME = Axis(label="time", unit="s")
PLOT = Plot(
    name="every-form",
    panels=(
        Panel(
            x=TIME,
            y=Axis(label="torque", unit="N m", least=-3.0, most=3.0),
            lines=(
                Line(label="model", x=(0, 1, 2), y=(0, 1, 2), stroke=0, reach=(0.1, 0.2, 0.3)),
                Line(label="measured", x=(0, 1, 2), y=(0, 2, 1), stroke="ink", dash="dotted"),
                Line(label="other times", x=(0, 3), y=(1, 1), stroke=1, is_named=False),
            ),
            limits=(-2.5, 2.5),
        ),
        Panel(
            x=Axis(label="frequency", unit="Hz", log=True),
            y=Axis(label="residual", unit="N m", log=True),
            title="axis1",
            lines=(
                Line(
                    label="residual",
                    x=(1, 10, 100),
                    y=(1, 2, 3),
                    stroke="red",
                    points=True,
                    marker="triangle",
                    reach=(0.1, 0.1, 0.1),
                ),
            ),
        ),
        Panel(
            x=TIME,
            y=Axis(label="active limit"),
            spans=(
                Stretch(name="torque", begin=0.0, end=1.0),
                Stretch(name="speed", begin=1.0, end=2.0, colour="faint"),
                Stretch(name="torque", begin=2.0, end=3.0),
            ),
            zooms_with_previous=True,
        ),
        Panel(
            x=Axis(label="lateness", unit="µs"),
            y=Axis(label="cycles", log=True, least=0.5, most=400.0),
            bars=(Bar(name="0–1", value=100.0), Bar(name="≥ 1", value=0.0)),
        ),
    ),
    caption="All forms of a plot.",
)
TABLE = Table(
    columns=(Column(title="joint", is_text=True), Column(title="mass", unit="kg", digits=3)),
    rows=(("axis1", Interval(value=9.6123, reach=0.1234)), ("axis2", 2.0), ("axis3", None)),
    failed=(False, True, False),
)


def test_digits_follow_from_the_interval_or_from_the_column() -> None:
    assert [row[1] for row in TABLE.cells()] == ["9.61 ± 0.12", "2", "–"]
    assert [column.head for column in TABLE.columns] == ["joint", "mass [kg]"]


@pytest.mark.parametrize("rows", [(("axis1",),), (("axis1", 1.0, 2.0),)])
def test_a_row_with_a_missing_cell_is_refused(rows: tuple[tuple[str | float, ...], ...]) -> None:
    with pytest.raises(ValidationError):
        Table(columns=TABLE.columns, rows=rows)


def test_a_line_with_unequal_numbers_of_x_and_y_is_refused() -> None:
    with pytest.raises(ValidationError):
        Line(label="a", x=(0.0, 1.0), y=(0.0,), stroke="ink")


def test_blocks_are_restored_from_json() -> None:
    blocks = (
        Heading(text="Result"),
        Text(text="A sentence."),
        Verdict(passed=True, text="Good."),
        TABLE,
        PLOT,
        Next(words=("record", "ir361")),
    )
    adapter: TypeAdapter[tuple[AnyBlock, ...]] = TypeAdapter(tuple[AnyBlock, ...])
    assert adapter.validate_json(adapter.dump_json(blocks)) == blocks


def test_a_terminal_shows_text_tables_and_the_next_command(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_blocks((Text(text="A sentence."), TABLE, PLOT, Next(words=("runs",))), Console())
    assert capsys.readouterr().out.splitlines() == [
        "A sentence.",
        "joint  mass [kg]",
        "axis1  9.61 ± 0.12",
        "axis2  2",
        "axis3  –",
        "Next: rid-daq runs",
    ]


def test_an_interactive_plot_has_every_part() -> None:
    item: Any = figure_item(PLOT)
    parts = [
        (len(panel["lines"]), len(panel["limits"]), len(panel["spans"]), len(panel["bars"]))
        for panel in item["panels"]
    ]
    assert parts == [(3, 2, 0, 0), (1, 0, 0, 0), (0, 0, 3, 0), (0, 0, 0, 2)]
    lines, points, spans, bars = item["panels"]
    assert [line["dash"] for line in lines["lines"]] == ["solid", "dotted", "solid"]
    assert [line["isNamed"] for line in lines["lines"]] == [True, True, False]
    assert [line["reach"] is None for line in lines["lines"]] == [False, True, True]
    assert (lines["y"]["ends"], points["y"]["ends"]) == ([-3.0, 3.0], None)
    assert points["lines"][0]["marker"] == "triangle"
    assert (points["x"]["isLog"], points["y"]["isLog"]) == (True, True)
    assert [span["row"] for span in spans["spans"]] == [0, 1, 0]
    assert [bar["name"] for bar in bars["bars"]] == ["0–1", "≥ 1"]
    text = json.dumps(item, allow_nan=False, ensure_ascii=False)
    for word in ("time [s]", "torque [N m]", "frequency [Hz]", "active limit", "cycles"):
        assert word in text


def test_a_static_axis_that_counts_marks_whole_numbers_only() -> None:
    line = Line("power", (1.0, 2.0, 3.0), (20.0, 21.0, 22.0), "blue")
    panel = Panel(x=Axis("period", counts=True), y=Axis("power", "W"), lines=(line,))
    text = str(plot_svg(Plot(name="periods", panels=(panel,)), "a"))
    assert ">3<" in text
    assert ">1.5<" not in text


def test_a_static_plot_has_the_same_texts() -> None:
    text = str(plot_svg(PLOT, "a"))
    for word in ("time [s]", "torque [N m]", "frequency [Hz]", "model", "measured", "residual"):
        assert f">{word}<" in text
    assert ">other times<" not in text, "the legend does not contain it"
    assert ">speed<" in text
    assert ">0–1<" in text
    assert "var(--red)" in text


def test_panels_are_arranged_in_rows_of_the_given_number_of_columns() -> None:
    panels = tuple(PLOT.panels[1].model_copy(update={"title": f"axis{j}"}) for j in range(5))
    grid = Plot(name="grid", panels=panels, columns=3)
    text = str(plot_svg(grid, "a"))
    assert len(set(re.findall(r'id="(a-axes_\d+)"', text))) == 5
    for panel in panels:
        assert f">{panel.title}<" in text
    assert figure_item(grid)["isGrid"]


@pytest.mark.parametrize("dark", [False, True])
def test_the_page_has_every_colour_that_a_plot_can_name(dark: bool) -> None:
    declared = colours(dark=dark)
    assert all(f"--{name}: #" in declared for name in get_args(Colour))
