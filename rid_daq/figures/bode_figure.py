"""`bode_figure`: an axis' velocity controller as measured, and its loops with their margins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from bokeh.models import FixedTicker, GridPlot, NumeralTickFormatter
from bokeh.plotting import figure

from config.arrays import FloatArray
from rid_daq.figures.palette import BLUE, GREEN, INK, ORANGE, PURPLE, RED, SOFT
from rid_daq.figures.panel import (
    Drawn,
    add_hover,
    add_legend,
    layout,
    limit_line,
    outline,
    panel,
    source,
)
from rid_daq.report.sections.loop_curves import LoopMargins, OpenLoop
from rid_daq.report.sections.velocity_loops import AxisLoop

FREQUENCY: Final = "frequency [Hz]"
PHASE: Final = "phase [°]"
MAGNITUDE: Final = "magnitude [dB]"
SMALLEST_DB: Final = 1e-9
_TICKS: Final = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500]


def bode_figure(axis: AxisLoop) -> GridPlot:
    """Return a figure of one axis' velocity controller and of its opened loops.

    Above the controller's response with its errors, distortion and what was fitted; below the
    opened velocity and position loops with gain and phase margins.

    Parameters
    ----------
    axis : AxisLoop
        As measured by `rid-daq loop`.
    """
    panels = [*_controller(axis), *_loops(axis)]
    return layout(f"bode_{axis.joint}", panels, panels)


def controller_bode(axis: AxisLoop) -> GridPlot:
    """Return the upper half of `bode_figure`: the velocity controller."""
    panels = _controller(axis)
    return layout(f"controller_{axis.joint}", panels, panels)


def loops_bode(axis: AxisLoop) -> GridPlot:
    """Return the lower half of `bode_figure`: the opened loops."""
    panels = _loops(axis)
    return layout(f"loops_{axis.joint}", panels, panels)


def _controller(axis: AxisLoop) -> list[figure]:
    response, fit, over = axis.response, axis.response.fit, f"[dB over 1 {axis.unit}]"
    size, total = np.asarray(response.magnitude), np.asarray(response.std_total)
    phase = np.asarray(response.phase_deg)
    spread = np.degrees(np.arcsin(np.minimum(2.0 * total / size, 1.0)))
    gain = f"gain {over}"
    measured = source(
        "measured controller",
        {
            FREQUENCY: response.frequency_hz,
            gain: _db(size),
            f"gain - 2σ {over}": _db(size - 2.0 * total),
            f"gain + 2σ {over}": _db(size + 2.0 * total),
            f"σ {over}": _db(total),
            f"σ by noise {over}": _db(response.std_noise),
            PHASE: phase,
            "phase - 2σ [°]": phase - spread,
            "phase + 2σ [°]": phase + spread,
        },
    )
    fitted = source(
        "fitted controller",
        {FREQUENCY: fit.frequency_hz, gain: _db(fit.magnitude), PHASE: fit.phase_deg},
    )
    top = panel(f"{axis.joint}: velocity controller", "", f"gain {over}", height=280, x_scale="log")
    below = panel("", FREQUENCY, PHASE, height=150, x_scale="log", x_range=top.x_range)
    top.xaxis.visible = False
    fits = [
        plot.line(FREQUENCY, name, source=fitted, line_color=ORANGE, line_width=4.0)
        for plot, name in ((top, gain), (below, PHASE))
    ]
    bars = [
        plot.segment(
            FREQUENCY, low, FREQUENCY, high, source=measured, line_color=SOFT, line_width=1.5
        )
        for plot, low, high in (
            (top, f"gain - 2σ {over}", f"gain + 2σ {over}"),
            (below, "phase - 2σ [°]", "phase + 2σ [°]"),
        )
    ]
    dots = [
        plot.scatter(FREQUENCY, name, source=measured, size=5, color=INK)
        for plot, name in ((top, gain), (below, PHASE))
    ]
    sigma = [
        top.line(FREQUENCY, f"σ {over}", source=measured, line_color=SOFT, line_width=1.5),
        top.line(
            FREQUENCY,
            f"σ by noise {over}",
            source=measured,
            line_color=SOFT,
            line_width=1.5,
            line_dash="dashed",
        ),
    ]
    entries: dict[str, list[Drawn]] = {
        "measured ± 2σ": dots + bars,
        "fitted PI": fits,
        "σ": sigma[:1],
        "σ by noise": sigma[1:],
    }
    for word, found, marker, color in (
        ("odd distortion", response.odd, "triangle", RED),
        ("even distortion", response.even, "inverted_triangle", PURPLE),
    ):
        if found.level:
            rows = source(
                word,
                {
                    FREQUENCY: found.frequency_hz,
                    f"level {over}": _db(found.level),
                    f"noise {over}": _db(found.noise),
                },
            )
            entries[word] = [
                top.scatter(
                    FREQUENCY, f"level {over}", source=rows, marker=marker, size=6, color=color
                )
            ]
    add_hover(top, dots[0], {"frequency": FREQUENCY, "gain": gain, "phase": PHASE}, digits=4)
    add_legend(top, entries)
    _frequencies(below)
    return [top, below]


def _loops(axis: AxisLoop) -> list[figure]:
    cascade = axis.cascade
    top = panel(
        f"{axis.joint}: opened loops\n{_words(cascade.position.margins)}",
        "",
        MAGNITUDE,
        height=240,
        x_scale="log",
        y_range=(-50.0, 50.0),
    )
    below = panel(
        "", FREQUENCY, PHASE, height=200, x_scale="log", x_range=top.x_range, y_range=(-300.0, 0.0)
    )
    top.xaxis.visible = False
    limit_line(top, 0.0)
    limit_line(below, -180.0)
    below.yaxis.ticker = FixedTicker(ticks=[-270, -180, -90, 0])
    entries: dict[str, list[Drawn]] = {}
    for word, loop, color, dash in (
        ("velocity loop", cascade.velocity, GREEN, "dashed"),
        ("position loop", cascade.position, BLUE, "solid"),
    ):
        entries[word] = _loop(top, below, word, cascade.frequency_hz, loop, color, dash)
    rows = source(
        "position loop as measured",
        {
            FREQUENCY: cascade.measured.frequency_hz,
            MAGNITUDE: _db(cascade.measured.magnitude),
            PHASE: cascade.measured.phase_deg,
        },
    )
    entries["measured"] = [
        plot.scatter(FREQUENCY, name, source=rows, size=5, color=INK)
        for plot, name in ((top, MAGNITUDE), (below, PHASE))
    ]
    add_legend(top, entries)
    _frequencies(below)
    return [top, below]


def _loop(
    top: figure,
    below: figure,
    word: str,
    frequency_hz: Sequence[float],
    loop: OpenLoop,
    color: str,
    dash: str,
) -> list[Drawn]:
    """Draw an opened loop and its margins; return what its name in the legend hides."""
    rows = source(
        word, {FREQUENCY: frequency_hz, MAGNITUDE: _db(loop.magnitude), PHASE: loop.phase_deg}
    )
    lines = [
        plot.line(FREQUENCY, name, source=rows, line_color=color, line_width=2.0, line_dash=dash)
        for plot, name in ((top, MAGNITUDE), (below, PHASE))
    ]
    shown = {word: FREQUENCY, "magnitude": MAGNITUDE, "phase": PHASE}
    add_hover(top, lines[0], shown, digits=4)
    add_hover(below, lines[1], shown, digits=4)
    return [*lines, *_margins(top, below, loop.margins, color)]


def _margins(top: figure, below: figure, margins: LoopMargins, color: str) -> list[Drawn]:
    """Mark gain and phase margin where they are, with their sizes."""
    marks: list[Drawn] = []
    gain, gain_at = margins.gain_db, margins.phase_crossover_hz
    phase, phase_at = margins.phase_deg, margins.crossover_hz
    if gain is not None and gain_at is not None:
        marks += _mark(top, gain_at, -gain, 0.0, f"{gain:.1f} dB", color)
    if phase is not None and phase_at is not None:
        marks += _mark(below, phase_at, -180.0, phase - 180.0, f"{phase:.0f}°", color)
    return marks


def _mark(plot: figure, at: float, low: float, high: float, text: str, color: str) -> list[Drawn]:
    where = outline(
        {"x": [at], "low": [low], "high": [high], "middle": [0.5 * (low + high)], "text": [text]}
    )
    return [
        plot.segment("x", "low", "x", "high", source=where, line_color=color, line_width=4.0),
        plot.text(
            "x",
            "middle",
            "text",
            source=where,
            x_offset=6,
            text_baseline="middle",
            text_font_size="12px",
            text_color=color,
        ),
    ]


def _words(margins: LoopMargins) -> str:
    phase, gain = margins.words
    return f"position loop {phase}, {gain}"


def _frequencies(plot: figure) -> None:
    plot.xaxis.ticker = FixedTicker(ticks=_TICKS)
    plot.xaxis.formatter = NumeralTickFormatter(format="0.[00]")


def _db(values: Sequence[float] | FloatArray) -> FloatArray:
    """Return magnitudes in decibels; not a number where there is nothing."""
    array = np.asarray(values, dtype=np.float64)
    kept = np.maximum(array, SMALLEST_DB)
    return np.asarray(np.where(array > 0.0, 20.0 * np.log10(kept), np.nan))
