"""`panel`: one plot with its axes; common parts of all figures: data, hover, legends, layout."""

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
"""A curve, points or an area in a panel."""

Scale: TypeAlias = Literal["auto", "log"]
_HoverFormat: TypeAlias = Literal["numeral", "datetime", "printf"] | CustomJSHover
Ranges: TypeAlias = Any
"""Range of a Bokeh axis: its own range, the range of another panel, or (start, end)."""


def csv_source(name: str, columns: Mapping[str, Any]) -> ColumnDataSource:
    """Return a data source whose columns are also in the figure's CSV.

    Args:
        name: Name of the data, such as a joint.
        columns: Numbers or texts by column name, with the unit in brackets: `"time [s]"`. Numbers
            keep seven digits.
    """
    return ColumnDataSource(data={key: _column(row) for key, row in columns.items()}, name=name)


def source_outside_csv(columns: Mapping[str, Any]) -> ColumnDataSource:
    """Return a data source that is not written to the figure's CSV, such as an ellipse."""
    return ColumnDataSource(data={key: _column(row) for key, row in columns.items()})


def _column(values: Any) -> Any:
    array = np.asarray(values)
    if array.dtype.kind in "fiub":
        return np.ascontiguousarray(array, dtype=np.float32)
    return [make_printable(str(value)) for value in array.tolist()]


def plot_text(text: str) -> str:
    """Return a text for Bokeh with visible control characters and without formulas."""
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

    Dragging zooms. The mouse wheel zooms with the control key only, so that the page still scrolls.
    Two fingers zoom on a touch screen.

    Args:
        title: Title above the plot.
        x_label: Label of the x axis with its unit.
        y_label: Label of the y axis with its unit.
        height: Height [px].
        x_range: Range of another panel, to zoom both together; or start and end.
        y_range: Range of another panel, to zoom both together; or start and end.
        x_scale: "log" for a logarithmic axis.
        y_scale: "log" for a logarithmic axis.
    """
    ranges = {"x_range": x_range, "y_range": y_range}
    zoom = BoxZoomTool()
    plot = figure(
        title=plot_text(title),
        x_axis_label=plot_text(x_label),
        y_axis_label=plot_text(y_label),
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
    plot.toolbar.active_drag = zoom  # by default, a drag would pan the plot
    return plot


def panel_to_scale(title: str, x_label: str, y_label: str, height: int) -> figure:
    """Return an empty plot with the same scale on both axes; otherwise as `panel`."""
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


def add_limit_line(plot: figure, at: float, color: str) -> None:
    """Draw a horizontal line across a plot at a value."""
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
    """Show values at the pointer, or at the point that a finger taps.

    Args:
        plot: The plot.
        renderer: The curve or points to which the values belong.
        rows: Column names by the labels that are shown.
        along_x: True if the values are shown wherever the pointer has the x value of the point.
        digits: Significant digits of numbers.
    """
    assert isinstance(renderer.data_source, ColumnDataSource)
    data = renderer.data_source.data
    formats = {key: isinstance(data[key], np.ndarray) for key in rows.values()}
    shown = [
        (plot_text(word), f"@{{{key}}}" + (f"{{%.{digits}g}}" if formats[key] else ""))
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
    """Add a legend above a plot; a click on a name hides its lines."""
    items = [
        LegendItem(label=plot_text(word), renderers=list(own)) for word, own in entries.items()
    ]
    widest = GLYPH_PX + LETTER_PX * max(len(word) for word in entries)
    legend = Legend(
        items=items,
        orientation="horizontal",
        ncols=max(1, NARROWEST_PX // widest),
        click_policy="hide",
        location="left",
    )
    plot.add_layout(legend, "above")


def row_of_panels(panels: Sequence[UIElement]) -> Row:
    """Return panels in a row; a narrow page shows them below each other."""
    return Row(
        children=list(panels),
        sizing_mode="stretch_width",
        styles={"flex-wrap": "wrap", "gap": "8px"},
    )


def figure_layout(name: str, parts: Sequence[UIElement], panels: Sequence[figure]) -> GridPlot:
    """Return a complete figure: its parts below each other, with one toolbar for all panels.

    Args:
        name: Name of the figure's CSV and SVG files.
        parts: Panels, or rows of panels.
        panels: All panels in `parts`.
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
