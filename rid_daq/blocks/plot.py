"""`Plot`: a figure, declared once; renderers draw it for paper, for zooming and for programs."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import ConfigDict, Strict, model_validator
from pydantic.dataclasses import dataclass

from config.model import ConfigModel

Colour = Literal["ink", "soft", "faint", "blue", "sky", "orange", "green", "red", "purple"]
"""A colour of the palette, light and dark."""

Dash = Literal["solid", "dashed", "dotted", "dotdash"]
Marker = Literal["circle", "square", "diamond", "triangle", "inverted_triangle"]
Numbers = Annotated[tuple[float, ...], Strict(False)]
Gapped = Annotated[tuple[float | None, ...], Strict(False)]
"""Numbers; None where a line has a gap."""

_CHECKED: Final = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True, config=_CHECKED)
class Axis:
    """An axis of a panel.

    Attributes:
        label, unit: What is drawn along it, and its unit; 1 for a ratio.
        log: True for a logarithmic scale.
        least, most: Ends of the axis; by the data if None.
    """

    label: str
    unit: str
    log: bool = False
    least: float | None = None
    most: float | None = None

    @property
    def text(self) -> str:
        """The label with the unit."""
        return f"{self.label} [{self.unit}]"


@dataclass(frozen=True, config=_CHECKED)
class Line:
    """A line of a panel, or points.

    Attributes:
        label: Its name in the legend and beside the pointer.
        x, y: One value a point; y is None in a gap.
        stroke: Its colour; the number of a joint for that joint's colour and dash.
        dash: How it is drawn; None for solid, or for the dash of the joint.
        width: Its width [px].
        points: True for points that are not connected.
        marker: Shape of the points.
        reach: Half width of an interval: a band around a line, error bars of points.
        reach_x: Half width of an interval of x, of points.
        is_area: True for a closed outline that is filled.
        is_named: True if the legend names it.
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
    """A text beside a point, such as the size of a margin."""

    x: float
    y: float
    text: str
    colour: Colour = "ink"


@dataclass(frozen=True, config=_CHECKED)
class Span:
    """From where to where along x something holds; spans of one name share a row."""

    name: str
    begin: float
    end: float
    colour: Colour = "blue"


@dataclass(frozen=True, config=_CHECKED)
class Bar:
    """The value of a named class, such as a bin of a histogram."""

    name: str
    value: float


class Panel(ConfigModel):
    """One pair of axes: lines, bars, or rows of spans.

    Attributes:
        x, y: The axes; of a panel of spans y is not drawn.
        lines: Drawn in this order.
        limits: Values of y that a line across the panel marks.
        marks: Texts beside points.
        spans: Rows of spans.
        bars: Bars beside each other, each named on the x axis.
        height_px: Height [px]; a panel of spans is as high as its rows.
        is_to_scale: True if a unit is as long along both axes.
        zooms_with_previous: True if it shares the x axis of the panel before it.
        title: What it shows, such as a joint; empty if there is nothing to tell apart. On paper it
            begins a drawing of its own, unless panels stand beside each other.
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
        """Return True if this panel continues the one above, so that both need one x axis."""
        return self.zooms_with_previous and not self.title and self.x.text == previous.x.text

    @property
    def rows(self) -> tuple[str, ...]:
        """The names of the spans, from top to bottom."""
        return tuple(dict.fromkeys(span.name for span in self.spans))


class Plot(ConfigModel):
    """A figure.

    Attributes:
        name: What its files are called.
        panels: From top to bottom, or row by row.
        caption: What a reader must know to read it.
        columns: Most panels beside each other; a narrow screen has fewer.
    """

    kind: Literal["plot"] = "plot"
    name: str
    panels: tuple[Panel, ...]
    caption: str = ""
    columns: int = 1
