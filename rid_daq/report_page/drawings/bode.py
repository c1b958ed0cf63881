"""The report's Bode figures: velocity controllers with their errors, and loops with margins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from rid_daq.figures.palette import FAINT, GREEN, ORANGE, PURPLE, SOFT
from rid_daq.report.sections.loop_curves import CascadeCurves, LoopMargins
from rid_daq.report.sections.velocity_loops import AxisLoop
from rid_daq.report_page.drawings.curves import MEASURED, PREDICTED, STYLE, WRONG, as_label, as_svg

EVEN, NOISE, LINE = PURPLE, SOFT, SOFT
SMALLEST_DB = 1e-9


def controller_figure(axis: AxisLoop, name: str) -> Markup:
    """Draw one velocity controller's frequency response, its errors, and what was fitted.

    Parameters
    ----------
    axis : AxisLoop
        Whose `response` is drawn.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    response = axis.response
    f, size = _array(response.frequency_hz), _array(response.magnitude)
    total, noise = _array(response.std_total), _array(response.std_noise)
    fit = response.fit
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
        fitted: Any = {"color": ORANGE, "linewidth": 2.4}
        top.plot(fit.frequency_hz, _db(fit.magnitude), label="fitted PI", **fitted)
        reach = 2.0 * total
        top.fill_between(
            f,
            _db(size - reach),
            _db(size + reach),
            color=PREDICTED,
            alpha=0.25,
            linewidth=0.0,
            label="measured ± 2σ",
        )
        top.plot(f, _db(size), "o", color=MEASURED, markersize=3.0, label="measured")
        top.plot(f, _db(total), color=LINE, linewidth=1.2, label="σ in all")
        top.plot(f, _db(noise), color=NOISE, linewidth=1.2, linestyle="--", label="σ by noise")
        for distortion, label, marker, colour in (
            (response.odd, "odd distortion", "^", WRONG),
            (response.even, "even distortion", "v", EVEN),
        ):
            top.plot(
                distortion.frequency_hz,
                _db(distortion.level),
                marker,
                color=colour,
                markersize=3.0,
                linestyle="",
                label=label,
            )
        both = [(each.frequency_hz, each.noise) for each in (response.even, response.odd)]
        where = np.concatenate([_array(at) for at, _ in both])
        floor = np.concatenate([_array(noise) for _, noise in both])
        order = np.argsort(where)
        top.plot(
            where[order],
            _db(floor[order]),
            ":",
            color=FAINT,
            linewidth=1.4,
            label="noise at empty lines",
        )
        top.set_ylabel(f"dB over 1 {as_label(axis.unit)}")
        figure.legend(loc="outside upper left", ncols=8, fontsize=7.5, columnspacing=1.2)
        bottom.plot(fit.frequency_hz, fit.phase_deg, **fitted)
        spread = np.degrees(np.arcsin(np.minimum(reach / size, 1.0)))
        phase = _array(response.phase_deg)
        bottom.fill_between(
            f, phase - spread, phase + spread, color=PREDICTED, alpha=0.25, linewidth=0.0
        )
        bottom.plot(f, phase, "o", color=MEASURED, markersize=3.0)
        bottom.set_ylabel("phase [°]")
        _frequencies(bottom, float(f[0]), float(f[-1]))
        return as_svg(figure, name)


def cascade_figure(cascade: CascadeCurves, name: str) -> Markup:
    """Draw the opened velocity and position loop of an axis, with their margins.

    Parameters
    ----------
    cascade : CascadeCurves
        The loops; the measured position loop is drawn at its lines.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    f = _array(cascade.frequency_hz)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.0), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True)
        for loop, label, colour, margins in (
            (cascade.velocity, "velocity loop", GREEN, GREEN),
            (cascade.position, "position loop", PREDICTED, PREDICTED),
        ):
            top.plot(f, _db(loop.magnitude), color=colour, linewidth=1.4, label=label)
            bottom.plot(f, loop.phase_deg, color=colour, linewidth=1.4)
            _margins(top, bottom, loop.margins, margins)
        measured = cascade.measured
        dots: Any = {"color": MEASURED, "markersize": 3.0, "linestyle": ""}
        top.plot(
            measured.frequency_hz,
            _db(measured.magnitude),
            "o",
            label="position loop, measured",
            **dots,
        )
        bottom.plot(measured.frequency_hz, measured.phase_deg, "o", **dots)
        top.axhline(0.0, color=LINE, linewidth=0.8)
        bottom.axhline(-180.0, color=LINE, linewidth=0.8)
        top.set_ylim(-50.0, 50.0)
        bottom.set_ylim(-300.0, 0.0)
        bottom.set_yticks([-270, -180, -90, 0])
        top.set_ylabel("magnitude [dB]")
        bottom.set_ylabel("phase [°]")
        figure.legend(loc="outside upper left", ncols=3, fontsize=8.0)
        _frequencies(bottom, float(f[0]), float(f[-1]))
        return as_svg(figure, name)


def _margins(top: Axes, bottom: Axes, margins: LoopMargins, colour: str) -> None:
    """Mark gain and phase margin where they are, with their sizes."""
    gain, gain_at = margins.gain_db, margins.phase_crossover_hz
    phase, phase_at = margins.phase_deg, margins.crossover_hz
    beside: Any = {"textcoords": "offset points", "xytext": (5, 0), "va": "center"}
    words: Any = {**beside, "fontsize": 8.0, "color": colour}
    if gain is not None and gain_at is not None:
        top.plot([gain_at, gain_at], [-gain, 0.0], color=colour, linewidth=2.0)
        top.annotate(f"{gain:.1f} dB", (gain_at, -0.5 * gain), **words)
    if phase is not None and phase_at is not None:
        bottom.plot([phase_at, phase_at], [-180.0, phase - 180.0], color=colour, linewidth=2.0)
        bottom.annotate(f"{phase:.0f}°", (phase_at, 0.5 * phase - 180.0), **words)


def _frequencies(panel: Axes, first: float, last: float) -> None:
    panel.set_xscale("log")
    panel.set_xlim(0.93 * first, 1.07 * last)
    ticks = [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200) if first <= t <= last]
    panel.set_xticks(ticks)
    panel.xaxis.set_major_formatter(ScalarFormatter())
    panel.minorticks_off()
    panel.set_xlabel("frequency [Hz]")


def _db(values: Sequence[float] | Any) -> Any:
    return 20.0 * np.log10(np.maximum(_array(values), SMALLEST_DB))


def _array(values: Sequence[float] | Any) -> Any:
    return np.asarray(values, dtype=float)
