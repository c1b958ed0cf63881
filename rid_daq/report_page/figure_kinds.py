"""How each kind of figure of a report is made; whoever imports it loads what draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from bokeh.models import GridPlot

from rid_daq.figures.bode_figure import controller_bode, loops_bode
from rid_daq.figures.centre_of_gravity import CentreOfGravity
from rid_daq.figures.embedding import as_item
from rid_daq.figures.lateness_figure import lateness_figure
from rid_daq.figures.path_figure import path_figure
from rid_daq.figures.payload_figure import payload_figure
from rid_daq.figures.plot_figure import plot_figure
from rid_daq.figures.stop_figure import stop_figure
from rid_daq.figures.truth_figure import truth_figure
from rid_daq.report.sections.payload import PayloadSection


def _centre(section: PayloadSection) -> GridPlot:
    return payload_figure(CentreOfGravity.of_section(section))


FIGURES: Final[dict[str, Callable[..., GridPlot]]] = {
    "centre": _centre,
    "controller": controller_bode,
    "lateness": lateness_figure,
    "loops": loops_bode,
    "path": path_figure,
    "plot": plot_figure,
    "stop": stop_figure,
    "truth": truth_figure,
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
