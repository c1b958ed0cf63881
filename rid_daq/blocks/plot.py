"""`Plot`: figure, declared once; renderers draw it for paper, for zooming and for programs."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import ConfigDict, Strict, model_validator
from pydantic.dataclasses import dataclass

from config.model import ConfigModel

Colour = Literal["ink", "soft", "faint", "blue", "sky", "orange", "green", "red", "purple"]
"""Colour of the palette, which has a light and a dark variant."""

Dash = Literal["solid", "dashed", "dotted", "dotdash"]
Marker = Literal["circle", "square", "diamond", "triangle", "inverted_triangle"]
Numbers = Annotated[tuple[float, ...], Strict(False)]
Gapped = Annotated[tuple[float | None, ...], Strict(False)]
"""Numbers; None in a gap of the line."""

_CHECKED: Final = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True, config=_CHECKED)
class Axis:
    """Axis of a panel.

    Attributes:
        label, unit: Quantity, and its unit; empty for a ratio or a number.
        log: True for a logarithmic scale.
        least, most: Ends of the axis; None for the range of the data.
        counts: True if the axis counts something, so that only whole numbers are marked.
    """

    label: str
    unit: str = ""
    log: bool = False
    least: float | None = None
    most: float | None = None
    counts: bool = False

    @property
    def text(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


@dataclass(frozen=True, config=_CHECKED)
class Line:
    """Line of a panel, or unconnected points.

    Attributes:
        label: Name in the legend and at the pointer.
        x, y: One value per point; y is None in a gap.
        stroke: Name of a colour; or the number of a joint, for the colour and dash of that joint.
        dash: Dash of the line; None for solid, or for the joint's dash.
        width: Width [px].
        points: True for unconnected points.
        marker: Shape of the points.
        reach: Half width of an interval: a band around a line, error bars of points.
        reach_x: Half width of an interval of x; for points only.
        is_area: True for a closed, filled outline.
        is_named: True if the legend contains the label.
    """

    label: str
    x: Numbers
    y: Gapped
    stroke: Colour | int
    dash: Dash | None = None
    width: float = 1.8
    points: bool = False
    marker: Marker = "circle"
    reach: Numbers | None = None
    reach_x: Numbers | None = None
    is_area: bool = False
    is_named: bool = True

    @model_validator(mode="after")
    def _require_equal_lengths(self) -> Line:
        columns = (self.x, self.y, self.reach, self.reach_x)
        if len({len(each) for each in columns if each is not None}) != 1:
            raise ValueError(f"{self.label}: x, y and reach have different lengths")
        return self


@dataclass(frozen=True, config=_CHECKED)
class Mark:
    """Text next to a point, such as the size of a margin."""

    x: float
    y: float
    text: str
    colour: Colour = "ink"


@dataclass(frozen=True, config=_CHECKED)
class Span:
    """Range of x with a name; spans with the same name share a row."""

    name: str
    begin: float
    end: float
    colour: Colour = "blue"


@dataclass(frozen=True, config=_CHECKED)
class Bar:
    """A bar with its name, such as a bin of a histogram."""

    name: str
    value: float


class Panel(ConfigModel):
    """One pair of axes: lines, bars, or rows of spans.

    Attributes:
        x, y: The axes; y is not drawn for a panel of spans.
        lines: Lines in drawing order.
        limits: Values of y that are marked by a line across the panel.
        marks: Texts next to points.
        spans: Rows of spans.
        bars: Bars side by side, each named on the x axis.
        height_px: Height [px]; the height of a panel of spans follows from its rows.
        is_to_scale: True for the same scale on both axes.
        zooms_with_previous: True if this panel and the previous one are zoomed together in x.
        title: Subject, such as a joint; empty if there is only one subject. On paper, a panel with
            a title begins a new drawing, unless panels are side by side.
    """

    x: Axis
    y: Axis
    lines: tuple[Line, ...] = ()
    limits: Numbers = ()
    marks: tuple[Mark, ...] = ()
    spans: tuple[Span, ...] = ()
    bars: tuple[Bar, ...] = ()
    height_px: int = 240
    is_to_scale: bool = False
    zooms_with_previous: bool = False
    title: str = ""

    def hides_x_of(self, previous: Panel) -> bool:
        """Return True if this panel and the panel above can share one x axis."""
        return self.zooms_with_previous and not self.title and self.x.text == previous.x.text

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the spans, from top to bottom."""
        return tuple(dict.fromkeys(span.name for span in self.spans))


class Plot(ConfigModel):
    """Figure.

    Attributes:
        name: Base name of its files.
        panels: From top to bottom, or row by row.
        caption: Explanation for the reader.
        columns: Maximum number of panels side by side; narrow screens show fewer.
    """

    kind: Literal["plot"] = "plot"
    name: str
    panels: tuple[Panel, ...]
    caption: str = ""
    columns: int = 1
