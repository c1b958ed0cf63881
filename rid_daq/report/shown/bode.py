"""`bode_plot`: the velocity controller and the opened loops of an axis, with their margins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Mark, Marker, Panel, Plot
from rid_daq.report.sections.loop_curves import ControllerResponse, DistortionSection, OpenLoop
from rid_daq.report.sections.velocity_loops import AxisLoop

SMALLEST_DB: Final = -180.0
FREQUENCY: Final = Axis(label="frequency", unit="Hz", log=True)


def bode_plot(axis: AxisLoop) -> Plot:
    """Return the response of the controller with its errors and fit, and the opened loops."""
    return Plot(
        name=f"bode_{axis.joint}",
        panels=(_gain(axis), _phase(axis.response), *_opened(axis)),
        caption="Controller: torque over velocity error, at the lines of the multisine. Triangles:"
        " torque at lines that are not excited and that the controller does not explain, over the"
        " velocity error beside it. Opened loops: bars are the margins.",
    )


def _gain(axis: AxisLoop) -> Panel:
    response = axis.response
    size, total = np.asarray(response.magnitude), np.asarray(response.std_total)
    x = response.frequency_hz
    return Panel(
        x=FREQUENCY,
        y=Axis(label="gain", unit=f"dB over 1 {axis.unit}"),
        lines=(
            _band(x, _db(size - 2.0 * total), _db(size + 2.0 * total)),
            Line(
                label="fitted PI",
                x=response.fit.frequency_hz,
                y=_db(response.fit.magnitude),
                stroke="orange",
                width=3.2,
            ),
            Line(label="measured", x=x, y=_db(size), stroke="ink", points=True),
            Line(label="σ", x=x, y=_db(total), stroke="soft"),
            Line(label="σ by noise", x=x, y=_db(response.std_noise), stroke="soft", dash="dashed"),
            *_distortion("odd distortion", response.odd, "triangle", "red"),
            *_distortion("even distortion", response.even, "inverted_triangle", "purple"),
        ),
        height_px=300,
        title=f"{axis.joint}: velocity controller",
    )


def _distortion(
    word: str, found: DistortionSection, marker: Marker, colour: Colour
) -> Iterable[Line]:
    if found.level:
        yield Line(
            label=word,
            x=found.frequency_hz,
            y=_db(found.level),
            stroke=colour,
            points=True,
            marker=marker,
        )


def _phase(response: ControllerResponse) -> Panel:
    size, phase = np.asarray(response.magnitude), np.asarray(response.phase_deg)
    reach = 2.0 * np.asarray(response.std_total)
    spread = np.degrees(np.arcsin(np.minimum(reach / size, 1.0)))
    fit = response.fit
    return Panel(
        x=FREQUENCY,
        y=Axis(label="phase", unit="°"),
        lines=(
            Line(
                label="phase of the fit",
                x=fit.frequency_hz,
                y=fit.phase_deg,
                stroke="orange",
                width=3.2,
                is_named=False,
            ),
            Line(
                label="measured phase ± 2σ",
                x=response.frequency_hz,
                y=phase.tolist(),
                stroke="ink",
                points=True,
                reach=spread.tolist(),
                is_named=False,
            ),
        ),
        height_px=160,
        zooms_with_previous=True,
    )


def _band(x: Sequence[float], low: Sequence[float], high: Sequence[float]) -> Line:
    return Line(
        label="measured ± 2σ",
        x=(*x, *reversed(x)),
        y=(*low, *reversed(high)),
        stroke="blue",
        is_area=True,
    )


def _opened(axis: AxisLoop) -> tuple[Panel, Panel]:
    cascade = axis.cascade
    loops: tuple[tuple[str, OpenLoop, Colour, Dash], ...] = (
        ("velocity loop", cascade.velocity, "green", "dashed"),
        ("position loop", cascade.position, "blue", "solid"),
    )
    sizes, phases, size_marks, phase_marks = [], [], [], []
    for word, loop, colour, dash in loops:
        x = cascade.frequency_hz
        sizes.append(Line(label=word, x=x, y=_db(loop.magnitude), stroke=colour, dash=dash))
        phases.append(
            Line(
                label=f"phase of the {word}",
                x=x,
                y=loop.phase_deg,
                stroke=colour,
                dash=dash,
                is_named=False,
            )
        )
        margins = loop.margins
        if margins.gain_db is not None and margins.phase_crossover_hz is not None:
            at, gain = margins.phase_crossover_hz, margins.gain_db
            sizes.append(_bar(f"gain margin, {word}", at, (-gain, 0.0), colour))
            size_marks.append(Mark(x=at, y=-0.5 * gain, text=f"{gain:.1f} dB", colour=colour))
        if margins.phase_deg is not None and margins.crossover_hz is not None:
            at, phase = margins.crossover_hz, margins.phase_deg
            phases.append(_bar(f"phase margin, {word}", at, (-180.0, phase - 180.0), colour))
            text = f"{phase:.0f}°"
            phase_marks.append(Mark(x=at, y=0.5 * phase - 180.0, text=text, colour=colour))
    measured = cascade.measured
    for lines, values, word in (
        (sizes, _db(measured.magnitude), ""),
        (phases, measured.phase_deg, "phase of the "),
    ):
        lines.append(
            Line(
                label=f"{word}position loop, measured",
                x=measured.frequency_hz,
                y=values,
                stroke="ink",
                points=True,
                is_named=not word,
            )
        )
    return (
        Panel(
            x=FREQUENCY,
            y=Axis(label="magnitude", unit="dB", least=-50.0, most=50.0),
            lines=tuple(sizes),
            limits=(0.0,),
            marks=tuple(size_marks),
            title=f"{axis.joint}: opened loops",
        ),
        Panel(
            x=FREQUENCY,
            y=Axis(label="phase", unit="°", least=-300.0, most=0.0),
            lines=tuple(phases),
            limits=(-180.0,),
            marks=tuple(phase_marks),
            height_px=200,
            zooms_with_previous=True,
        ),
    )


def _bar(label: str, at: float, ends: tuple[float, float], colour: Colour) -> Line:
    return Line(label=label, x=(at, at), y=ends, stroke=colour, width=3.2, is_named=False)


def _db(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(20.0 * math.log10(each) if each > 1e-9 else SMALLEST_DB for each in values)
