"""Curves: torque over time and frequency, deviations from the truth, lateness."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from rid_daq.figures.palette import (
    BLUE,
    GRID,
    INK,
    RED,
    SOFT,
)
from rid_daq.report.sections.timing import bin_names
from rid_daq.report.sections.validation import TruthCase
from rid_daq.report_page.drawings.page_colours import NAMES
from rid_daq.terminal.console import printable

MEASURED, PREDICTED, WRONG = INK, BLUE, RED


STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small, searchable, in the page's font
    "svg.hashsalt": "rid-daq",  # the same numbers give the same bytes
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.color": SOFT,
    "ytick.labelcolor": INK,
    "axes.edgecolor": SOFT,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
}


def truth_figure(cases: Sequence[TruthCase]) -> Markup:
    """Draw how far estimates lie from the truth, in standard uncertainties, for simulated cells.

    Parameters
    ----------
    cases : sequence of TruthCase
        One a plant.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.4), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(cases)))
        for panel, case in zip(panels, cases, strict=True):
            values = np.asarray(case.deviation_sigmas, dtype=float)
            number = np.arange(1, len(values) + 1)
            inside = np.abs(values) <= 2.0
            panel.axhspan(-2.0, 2.0, color=PREDICTED, alpha=0.10, linewidth=0.0)
            panel.plot(number[inside], values[inside], "o", color=PREDICTED, markersize=4.0)
            panel.plot(number[~inside], values[~inside], "o", color=WRONG, markersize=4.0)
            reach = max(4.0, 1.4 * float(np.max(np.abs(values), initial=0.0)))
            if reach > 10.0:
                panel.set_yscale("symlog", linthresh=3.0)
            panel.set_ylim(-reach, reach)
            panel.set_title(as_label(case.title), fontsize=9.0)
            panel.set_xlabel("parameter number")
        panels[0].set_ylabel("(estimate - truth) / σ")
        return as_svg(figure, "truth")


def histogram_figure(edges_us: Sequence[float], counts: Sequence[int], name: str) -> Markup:
    """Draw how late the cyclic task's cycles began; counts on a logarithmic scale.

    Parameters
    ----------
    edges_us : sequence of float
        The bins' lower edges [µs], one a bin; the last bin holds everything beyond.
    counts : sequence of int
        Cycles in each bin.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    number = np.asarray(counts, dtype=float)
    places = np.arange(len(number))
    labels = bin_names(edges_us)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.4), layout="constrained")
        panel = figure.subplots()
        bars = panel.bar(places, number, 0.9, color=PREDICTED)
        panel.bar_label(bars, [f"{count:.0f}" if count else "" for count in number], fontsize=7.5)
        if number.any():  # a motion that was stopped before it began has no cycle
            panel.set_yscale("log")
        panel.set_ylim(0.5, 4.0 * max(1.0, float(number.max(initial=0.0))))
        panel.set_xticks(places, labels, fontsize=7.5)
        panel.grid(visible=False, axis="x")
        panel.set_xlabel("lateness of the cycle [µs]")
        panel.set_ylabel("cycles")
        return as_svg(figure, name)


def as_label(text: str) -> str:
    """Return text for a figure, shown as it is: invisible characters visible, `$` no formula."""
    return printable(text).replace("$", r"\$")


def as_svg(figure: Figure, name: str) -> Markup:
    """Return a drawing as an element to put into a page, its ids made its own by a word.

    Its colours are the page's (`colours`), light or dark.
    """
    buffer = io.StringIO()
    # `savefig` would draw everything twice, once to lay it out; drawing lays it out as well.
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})
    drawing = buffer.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r"<path (?![^>]*\bd=)[^>]*/>", "", drawing)  # a line without any point
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = re.sub("|".join(NAMES), lambda found: f"var(--{NAMES[found[0]]})", drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    return Markup(
        re.sub(
            r'(<svg[^>]*?) width="[^"]*" height="[^"]*"|<metadata>.*?</metadata>\s*',
            lambda found: found.group(1) or "",
            drawing,
            flags=re.DOTALL,
        )
    )
