"""How each kind of figure of a report is made; whoever imports it loads what draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from bokeh.models import GridPlot

from rid_daq.figures.embedding import as_item
from rid_daq.figures.plot_figure import plot_figure
from rid_daq.figures.stop_figure import stop_figure

FIGURES: Final[dict[str, Callable[..., GridPlot]]] = {
    "plot": plot_figure,
    "stop": stop_figure,
}
"""How each kind of figure is made of what its template hands over."""


def item_of(kind: str, *shown: object) -> dict[str, object]:
    """Return a figure as Bokeh's item, light.

    Parameters
    ----------
    kind : str
        One of `FIGURES`.
    *shown : object
        What it is made of.
    """
    return as_item(FIGURES[kind](*shown), dark=False)
