"""`panel`: one plot with its axes, and what all figures share: data, hover, legends, layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from bokeh.models import (
    BoxZoomTool,
    Column,
    ColumnDataSource,
    CustomJSHover,
    DataRange1d,
    GridPlot,
    HoverTool,
    PanTool,
    ResetTool,
    Row,
    Tool,
    Toolbar,
    ToolProxy,
    WheelZoomTool,
)
from bokeh.models.annotations import Legend, LegendItem, Span
from bokeh.models.renderers import GlyphRenderer
from bokeh.models.ui import UIElement
from bokeh.plotting import figure

from rid_daq.terminal.console import make_printable

NARROWEST_PX: Final = 290
SCALED_PADDING: Final = 0.12
GLYPH_PX: Final = 44
LETTER_PX: Final = 6

Drawn: TypeAlias = "GlyphRenderer[Any]"
"""Something that was drawn in a panel."""

Scale: TypeAlias = Literal["auto", "log"]
_HoverFormat: TypeAlias = Literal["numeral", "datetime", "printf"] | CustomJSHover
Ranges: TypeAlias = Any
"""What bokeh takes as a range: its own, another panel's, or (start, end)."""


def source(name: str, columns: Mapping[str, Any]) -> ColumnDataSource:
    """Return data to draw, which the figure's CSV holds.

    Args:
        name: What it is of, such as a joint.
        columns: Numbers or texts by a name that people read, its unit in brackets: `"time [s]"`.
            Numbers are held to seven digits.
    """
    return ColumnDataSource(data={key: _column(row) for key, row in columns.items()}, name=name)


def outline(columns: Mapping[str, Any]) -> ColumnDataSource:
    """Return what is drawn beside the data, such as an ellipse; the CSV leaves it out."""
    return ColumnDataSource(data={key: _column(row) for key, row in columns.items()})


def _column(values: Any) -> Any:
    array = np.asarray(values)
    if array.dtype.kind in "fiub":
        return np.ascontiguousarray(array, dtype=np.float32)
    return [make_printable(str(value)) for value in array.tolist()]


def words(text: str) -> str:
    """Return a text as a plot shows it: no invisible characters, no formula."""
    return make_printable(text).replace("$$", "$ $").replace("\\(", "\\ (").replace("\\[", "\\ [")


def panel(
    title: str,
    x_label: str,
    y_label: str,
    *,
    height: int = 240,
    x_range: Ranges = None,
    y_range: Ranges = None,
    x_scale: Scale = "auto",
    y_scale: Scale = "auto",
) -> figure:
    """Return an empty plot as wide as its page.

    Dragging zooms; turning the wheel zooms with the control key, so that a page still scrolls; two
    fingers zoom.

    Args:
        title, x_label, y_label: Texts; labels have their units.
        height: [px].
        x_range, y_range: Of another panel, to be zoomed together; or start and end.
        x_scale, y_scale: "log" for a logarithmic axis.
    """
    ranges = {"x_range": x_range, "y_range": y_range}
    zoom = BoxZoomTool()
    plot = figure(
        title=words(title),
        x_axis_label=words(x_label),
        y_axis_label=words(y_label),
        x_axis_type=x_scale,
        y_axis_type=y_scale,
        height=height,
        min_width=NARROWEST_PX,
        sizing_mode="stretch_width",
        toolbar_location=None,
        tools=[
            zoom,
            PanTool(),
            WheelZoomTool(modifiers={"ctrl": True}),
            ResetTool(),
        ],
        **{key: value for key, value in ranges.items() if value is not None},
    )
    plot.toolbar.active_drag = zoom  # "auto" pans, whatever the toolbar of the figure says
    return plot


def panel_to_scale(title: str, x_label: str, y_label: str, height: int) -> figure:
    """Return an empty plot on which a metre is as long both ways; see `panel`."""
    plot = panel(
        title,
        x_label,
        y_label,
        height=height,
        x_range=DataRange1d(range_padding=SCALED_PADDING),
        y_range=DataRange1d(range_padding=SCALED_PADDING),
    )
    plot.match_aspect = True
    for tool in plot.tools:
        if isinstance(tool, BoxZoomTool):
            tool.match_aspect = True
    return plot


def limit_line(plot: figure, at: float, color: str) -> None:
    """Draw a line across a plot at a value."""
    plot.add_layout(
        Span(location=at, dimension="width", line_color=color, line_dash=[6, 4], line_width=1.2)
    )


def add_hover(
    plot: figure,
    renderer: Drawn,
    rows: Mapping[str, str],
    *,
    along_x: bool = False,
    digits: int = 5,
) -> None:
    """Show values where the pointer is, or where a finger taps.

    Args:
        plot, renderer: The plot, and what of it is pointed at.
        rows: Column by the word before it; a number is shown with `digits` digits.
        along_x: Whether the pointer need only be above or below.
        digits: Significant digits.
    """
    assert isinstance(renderer.data_source, ColumnDataSource)
    data = renderer.data_source.data
    formats = {key: isinstance(data[key], np.ndarray) for key in rows.values()}
    shown = [
        (words(word), f"@{{{key}}}" + (f"{{%.{digits}g}}" if formats[key] else ""))
        for word, key in rows.items()
    ]
    printf: dict[str, _HoverFormat] = {
        f"@{{{key}}}": "printf" for key, numeric in formats.items() if numeric
    }
    plot.add_tools(
        HoverTool(
            renderers=[renderer],
            tooltips=shown,
            formatters=printf,
            mode="vline" if along_x else "mouse",
            line_policy="nearest",
            point_policy="follow_mouse" if along_x else "snap_to_data",
        )
    )


def add_legend(plot: figure, entries: Mapping[str, Sequence[Drawn]]) -> None:
    """Name lines above a plot; a click on a name hides its lines."""
    items = [LegendItem(label=words(word), renderers=list(own)) for word, own in entries.items()]
    widest = GLYPH_PX + LETTER_PX * max(len(word) for word in entries)
    legend = Legend(
        items=items,
        orientation="horizontal",
        ncols=max(1, NARROWEST_PX // widest),
        click_policy="hide",
        location="left",
    )
    plot.add_layout(legend, "above")


def beside(panels: Sequence[UIElement]) -> Row:
    """Return panels beside each other, below each other where the page is narrow."""
    return Row(
        children=list(panels),
        sizing_mode="stretch_width",
        styles={"flex-wrap": "wrap", "gap": "8px"},
    )


def layout(name: str, parts: Sequence[UIElement], panels: Sequence[figure]) -> GridPlot:
    """Return a whole figure: one toolbar for all of its panels, and its parts below each other.

    Args:
        name: What its CSV and SVG files are called.
        parts: Panels, or rows of them.
        panels: All panels that are in them.
    """
    column = Column(children=list(parts), sizing_mode="stretch_width", spacing=6)
    return GridPlot(
        children=[(column, 0, 0)],
        toolbar=_toolbar(panels),
        toolbar_location="above",
        sizing_mode="stretch_width",
        name=name,
    )


def _toolbar(panels: Sequence[figure]) -> Toolbar:
    def together(kind: type[Tool]) -> ToolProxy:
        tools: list[Tool] = []
        tools += [tool for plot in panels for tool in plot.tools if isinstance(tool, kind)]
        return ToolProxy(tools=tools)

    zoom, wheel = together(BoxZoomTool), together(WheelZoomTool)
    others = [together(kind) for kind in (PanTool, ResetTool, HoverTool)]
    return Toolbar(tools=[zoom, wheel, *others], active_drag=zoom, active_scroll=wheel, logo=None)
