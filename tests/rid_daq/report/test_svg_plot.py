"""The drawing of a plot shows its values at the places that its axes state."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from rid_daq.blocks.plot import Axis, Bar, Line, Mark, Panel, Plot, Span
from rid_daq.report_page.drawings.scale import Scale, axis_ends
from rid_daq.report_page.drawings.svg_plot import WIDTH, plot_svg

TIME = Axis(label="time", unit="s")
TORQUE = Axis(label="torque", unit="N m")
SVG = "{http://www.w3.org/2000/svg}"


def drawing(*panels: Panel, columns: int = 1) -> ElementTree.Element:
    """Return the drawing of panels, which must be one well-formed element."""
    return ElementTree.fromstring(
        str(plot_svg(Plot(name="a", panels=panels, columns=columns), "a"))
    )


def paths(root: ElementTree.Element, attribute: str, value: str) -> list[list[tuple[float, float]]]:
    """Return the points of each subpath with absolute points and a given attribute."""
    found = (each.get("d", "") for each in root.iter(f"{SVG}path") if each.get(attribute) == value)
    return [
        [(float(x), float(y)) for x, y in re.findall(r"(-?[\d.]+),(-?[\d.]+)", part)]
        for d in found
        for part in re.findall(r"M([^M]*)", d)
    ]


def ticks(root: ElementTree.Element, anchor: str) -> list[tuple[float, float]]:
    """Return value and place of each tick with a number; those of y are anchored at their end."""
    axis = "x" if anchor == "middle" else "y"
    return [
        (float(words.replace("−", "-")), float(each.get(axis, "")))
        for each in root.iter(f"{SVG}text")
        if each.get("text-anchor") == anchor and re.fullmatch(r"−?[\d.]+", words := each.text or "")
    ]


def test_points_of_a_line_are_at_the_places_of_their_values() -> None:
    x, y = (0.0, 1.0, 2.0, 4.0), (0.5, -2.0, 3.0, 1.0)
    root = drawing(Panel(x=TIME, y=TORQUE, lines=(Line(label="a", x=x, y=y, stroke="red"),)))
    drawn = max(paths(root, "stroke", "var(--red)"), key=len)
    for values, anchor, column, shift in ((x, "middle", 0, 0.0), (y, "end", 1, -3.2)):
        stated, places = np.transpose(ticks(root, anchor))
        slope, start = np.polyfit(stated, places + shift, 1)
        found = [point[column] for point in drawn]
        np.testing.assert_allclose(found, slope * np.array(values) + start, atol=0.15)


def test_a_gap_divides_a_line_and_its_band() -> None:
    line = Line(
        label="a", x=(0, 1, 2, 3, 4, 5), y=(0, 1, None, 2, 1, 0), stroke="blue", reach=(0.1,) * 6
    )
    root = drawing(Panel(x=TIME, y=TORQUE, lines=(line,)))
    lengths = [len(part) for part in paths(root, "stroke", "var(--blue)")]
    assert lengths[:2] == [2, 3]
    assert [len(part) for part in paths(root, "fill-opacity", ".2")] == [4, 6]


def test_equal_neighbours_are_drawn_once() -> None:
    x = np.linspace(0.0, 1.0, 50_000)
    line = Line(label="a", x=tuple(x), y=tuple(np.zeros(50_000)), stroke="green")
    root = drawing(Panel(x=TIME, y=TORQUE, lines=(line,)))
    drawn = max(paths(root, "stroke", "var(--green)"), key=len)
    assert len(drawn) < 10.0 * WIDTH
    assert drawn[-1][0] - drawn[0][0] > 0.9 * WIDTH * 0.9


def test_points_have_error_bars_in_both_directions() -> None:
    line = Line(
        label="a", x=(1, 2), y=(1, 3), stroke="ink", points=True, reach=(0.5, 0.5), reach_x=(0.1, 0)
    )
    text = str(plot_svg(Plot(name="a", panels=(Panel(x=TIME, y=TORQUE, lines=(line,)),)), "a"))
    assert len(re.findall(r"M[\d.]+,[\d.]+V[\d.]+M[\d.]+,[\d.]+h4", text)) == 2
    assert len(re.findall(r"M[\d.]+,[\d.]+H[\d.]+M[\d.]+,[\d.]+v4", text)) == 2


def test_scales_to_scale_are_equal() -> None:
    circle = np.linspace(0.0, 2.0 * np.pi, 60)
    line = Line(label="a", x=tuple(np.cos(circle)), y=tuple(np.sin(circle)), stroke="red")
    root = drawing(Panel(x=TIME, y=TORQUE, lines=(line,), is_to_scale=True))
    points = np.array(max(paths(root, "stroke", "var(--red)"), key=len))
    wide, high = np.ptp(points, axis=0)
    assert wide == pytest.approx(high, abs=0.3)


def test_panels_that_zoom_together_have_one_range_which_contains_all() -> None:
    above = Panel(x=TIME, y=TORQUE, lines=(Line(label="a", x=(0, 1), y=(0, 1), stroke="red"),))
    spans = (Span(name="b", begin=0.5, end=3.0, colour="green"),)
    root = drawing(above, Panel(x=TIME, y=TORQUE, spans=spans, zooms_with_previous=True))
    box = next(each for each in root.iter(f"{SVG}rect") if each.get("fill") == "var(--green)")
    line = max(paths(root, "stroke", "var(--red)"), key=len)
    per_s = line[1][0] - line[0][0]
    assert float(box.get("x", "")) == pytest.approx(line[0][0] + 0.5 * per_s, abs=0.3)
    assert float(box.get("width", "")) == pytest.approx(2.5 * per_s, abs=0.5)


def test_bars_have_heights_in_proportion() -> None:
    bars = (Bar(name="one", value=1.0), Bar(name="none", value=0.0), Bar(name="three", value=3.0))
    root = drawing(Panel(x=TIME, y=TORQUE, bars=bars))
    boxes = [each for each in root.iter(f"{SVG}rect") if each.get("fill") == "var(--blue)"]
    low, high = (float(each.get("height", "")) for each in boxes)
    assert high == pytest.approx(3.0 * low, abs=0.4)


def test_texts_are_escaped_and_show_control_characters() -> None:
    panel = Panel(
        x=TIME,
        y=TORQUE,
        title="<b>\x1b",
        lines=(Line(label="a & b", x=(0, 1), y=(0, 1), stroke="red"),),
        marks=(Mark(x=0.5, y=0.5, text="</svg>"),),
    )
    texts = {each.text for each in drawing(panel).iter(f"{SVG}text")}
    assert {"a & b", "</svg>"} < texts
    assert not any("\x1b" in (each or "") for each in texts)


@pytest.mark.parametrize(
    ("low", "high", "spacing", "labels"),
    [
        (0.0, 1.0, 20.0, ("0.0", "0.2", "0.4", "0.6", "0.8", "1.0")),
        (-3.0, 3.0, 16.0, ("−3", "−2", "−1", "0", "1", "2", "3")),
        (0.0, 10.0, 25.0, ("0.0", "2.5", "5.0", "7.5", "10.0")),
        (0.0, 4e-7, 25.0, ("0", "1·10⁻⁷", "2·10⁻⁷", "3·10⁻⁷", "4·10⁻⁷")),
        (2e6, 4e6, 25.0, ("2.0·10⁶", "2.5·10⁶", "3.0·10⁶", "3.5·10⁶", "4.0·10⁶")),
    ],
)
def test_ticks_of_a_linear_axis_are_round(
    low: float, high: float, spacing: float, labels: tuple[str, ...]
) -> None:
    found = Scale(low, high, False, 0.0, 100.0).ticks(spacing)
    assert tuple(tick.label for tick in found) == labels


def test_ticks_of_a_logarithmic_axis() -> None:
    decades = Scale(0.5, 2e5, True, 0.0, 300.0)
    named = [tick for tick in decades.ticks(40.0) if tick.label]
    assert [tick.label for tick in named] == ["1", "10", "100", "1000", "10⁴", "10⁵"]
    np.testing.assert_allclose(
        np.diff(decades.place(np.array([tick.value for tick in named]))),
        300.0 / math.log10(4e5),
    )
    assert np.isnan(decades.place(np.array([0.0, -1.0]))).all()
    short = [tick.label for tick in Scale(0.9, 11.0, True, 0.0, 300.0).ticks(40.0) if tick.label]
    assert short == ["1", "2", "5", "10"]


def test_declared_ends_replace_those_of_the_data() -> None:
    values = [np.array([1.0, np.nan, 3.0])]
    assert axis_ends(TIME, values, 0.5) == (0.0, 4.0)
    assert axis_ends(Axis(label="t", unit="s", least=-1.0), values, 0.0) == (-1.0, 3.0)
    logarithmic = Axis(label="f", unit="Hz", log=True)
    assert axis_ends(logarithmic, [np.array([-1.0, 1.0, 100.0])], 0.0) == (1.0, 100.0)
    low, high = axis_ends(TIME, [np.array([2.0, 2.0])], 0.0)
    assert low < 2.0 < high
