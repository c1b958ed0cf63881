"""The report's figures: plain numbers to inline SVG."""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

MEASURED, PREDICTED, WRONG, FLOOR, GRID = "#1f2933", "#2563eb", "#c2410c", "#8593a3", "#e3e8ee"

_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small, searchable, in the page's font
    "svg.hashsalt": "rid-daq",  # the same numbers give the same bytes
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8593a3",
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
}


def torque_figure(
    time_s: Sequence[float],
    measured: Sequence[float],
    predicted: Sequence[float],
    unit: str,
    name: str,
) -> str:
    """Draw one axis' measured and predicted torque, and their difference below.

    Parameters
    ----------
    time_s, measured, predicted
        One value a sample.
    unit
        The torque's unit.
    name
        A word for the drawing's element names, different for every figure of a page.
    """
    t, tau, model = (np.asarray(x, dtype=float) for x in (time_s, measured, predicted))
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 3.5), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        top.plot(t, tau, color=MEASURED, linewidth=0.8, label="measured")
        top.plot(t, model, color=PREDICTED, linewidth=1.1, label="predicted")
        top.set_ylabel(f"torque [{unit}]")
        top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
        bottom.plot(t, tau - model, color=WRONG, linewidth=0.8)
        bottom.axhline(0.0, color=FLOOR, linewidth=0.6)
        bottom.set_ylabel(f"error [{unit}]")
        bottom.set_xlabel("time [s]")
        bottom.set_xlim(float(t[0]), float(t[-1]))
        return _svg(figure, name)


def spectrum_figure(frequency_hz: Sequence[float], axes: Sequence[dict[str, Any]]) -> str:
    """Draw every axis' residual amplitude per bin against the noise floor of the mean period.

    Parameters
    ----------
    frequency_hz
        The bins.
    axes
        One mapping an axis: `joint`, `residual_nm`, `noise_nm`, one value a bin each.
    """
    f = np.asarray(frequency_hz, dtype=float)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 2.9), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(axes), sharey=True, squeeze=True))
        for panel, axis in zip(panels, axes, strict=True):
            residual = np.asarray(axis["residual_nm"], dtype=float)
            noise = np.asarray(axis["noise_nm"], dtype=float)
            panel.semilogy(f, residual, ".", color=WRONG, markersize=3.0, label="residual")
            panel.semilogy(f, noise, color=FLOOR, linewidth=1.2, label="noise floor")
            panel.set_title(axis["joint"], fontsize=9.0)
            panel.set_xlabel("frequency [Hz]")
        panels[0].set_ylabel("torque amplitude")
        panels[0].legend(loc="upper right")
        return _svg(figure, "spectrum")


def truth_figure(cases: Sequence[dict[str, Any]]) -> str:
    """Draw how far estimates lie from the truth, in standard uncertainties, for simulated cells.

    Parameters
    ----------
    cases
        One mapping a plant: `title`, and `deviation_sigmas`, one value a parameter.
    """
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 2.4), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(cases)))
        for panel, case in zip(panels, cases, strict=True):
            values = np.asarray(case["deviation_sigmas"], dtype=float)
            number = np.arange(1, len(values) + 1)
            inside = np.abs(values) <= 2.0
            panel.axhspan(-2.0, 2.0, color=PREDICTED, alpha=0.10, linewidth=0.0)
            panel.plot(number[inside], values[inside], "o", color=PREDICTED, markersize=4.0)
            panel.plot(number[~inside], values[~inside], "o", color=WRONG, markersize=4.0)
            reach = max(4.0, 1.4 * float(np.max(np.abs(values), initial=0.0)))
            if reach > 10.0:
                panel.set_yscale("symlog", linthresh=3.0)
            panel.set_ylim(-reach, reach)
            panel.set_title(case["title"], fontsize=9.0)
            panel.set_xlabel("parameter number")
        panels[0].set_ylabel("(estimate - truth) / σ")
        return _svg(figure, "truth")


def histogram_figure(edges_us: Sequence[float], counts: Sequence[int], name: str) -> str:
    """Draw how late the cyclic task's cycles began; counts on a logarithmic scale.

    Parameters
    ----------
    edges_us
        The bins' lower edges [µs], one a bin; the last bin holds everything beyond.
    counts
        Cycles in each bin.
    name
        A word for the drawing's element names, different for every figure of a page.
    """
    number = np.asarray(counts, dtype=float)
    places = np.arange(len(number))
    labels = [f"{low:g}–{high:g}" for low, high in itertools.pairwise(edges_us)] + [
        f"≥ {edges_us[-1]:g}"
    ]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 2.4), layout="constrained")
        panel = figure.subplots()
        bars = panel.bar(places, number, 0.9, color=PREDICTED)
        panel.bar_label(bars, [f"{count:.0f}" if count else "" for count in number], fontsize=7.5)
        panel.set_yscale("log")
        panel.set_ylim(0.5, 4.0 * max(1.0, float(number.max(initial=0.0))))
        panel.set_xticks(places, labels, fontsize=7.5)
        panel.grid(visible=False, axis="x")
        panel.set_xlabel("lateness of the cycle [µs]")
        panel.set_ylabel("cycles")
        return _svg(figure, name)


def _svg(figure: Figure, name: str) -> str:
    """Return the drawing as an element to put into a page, its ids made its own."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    drawing = buffer.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    return re.sub(
        r'(<svg[^>]*?) width="[^"]*" height="[^"]*"|<metadata>.*?</metadata>\s*',
        lambda found: found.group(1) or "",
        drawing,
        flags=re.DOTALL,
    )
