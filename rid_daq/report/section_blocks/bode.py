"""`bode_plot`: the velocity controller and the open loops of an axis, with their margins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Mark, Marker, Panel, Plot
from rid_daq.report.sections.loop_curves import ControllerResponse, DistortionSection, OpenLoop
from rid_daq.report.sections.velocity_loops import AxisLoop

SMALLEST_DB: Final = -180.0
FREQUENCY: Final = Axis("frequency", "Hz", log=True)


def bode_plot(axis: AxisLoop) -> Plot:
    """Return the controller's response with its errors and fit, and the open loops."""
    return Plot(
        name=f"bode_{axis.joint}",
        panels=(_gain(axis), _phase(axis.response), *_open_loops(axis)),
        caption="Controller: torque over velocity error, at the excited lines of the multisine."
        " Triangles: distortion. This is the torque at lines that are not excited, without the"
        " part that the linear response explains, divided by the velocity error at the"
        " neighbouring excited lines. Open loops: the bars are the margins.",
    )


def _gain(axis: AxisLoop) -> Panel:
    response = axis.response
    size, total = np.asarray(response.magnitude), np.asarray(response.std_total)
    x = response.frequency_hz
    return Panel(
        x=FREQUENCY,
        y=Axis("gain", f"dB over 1 {axis.unit}"),
        lines=(
            _band(x, _db(size - 2.0 * total), _db(size + 2.0 * total)),
            Line(
                "fitted PI",
                response.fit.frequency_hz,
                _db(response.fit.magnitude),
                "orange",
                width=3.2,
            ),
            Line("measured", x, _db(size), "ink", points=True),
            Line("σ", x, _db(total), "soft"),
            Line("σ from noise", x, _db(response.std_noise), "soft", dash="dashed"),
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
        yield Line(word, found.frequency_hz, _db(found.level), colour, points=True, marker=marker)


def _phase(response: ControllerResponse) -> Panel:
    size, phase = np.asarray(response.magnitude), np.asarray(response.phase_deg)
    reach = 2.0 * np.asarray(response.std_total)
    spread = np.degrees(np.arcsin(np.minimum(reach / size, 1.0)))
    fit = response.fit
    return Panel(
        x=FREQUENCY,
        y=Axis("phase", "°"),
        lines=(
            Line(
                "phase of the fit",
                fit.frequency_hz,
                fit.phase_deg,
                "orange",
                width=3.2,
                is_named=False,
            ),
            Line(
                "measured phase ± 2σ",
                response.frequency_hz,
                phase.tolist(),
                "ink",
                points=True,
                reach=spread.tolist(),
                is_named=False,
            ),
        ),
        height_px=160,
        zooms_with_previous=True,
    )


def _band(x: Sequence[float], low: Sequence[float], high: Sequence[float]) -> Line:
    return Line("measured ± 2σ", (*x, *reversed(x)), (*low, *reversed(high)), "blue", is_area=True)


def _open_loops(axis: AxisLoop) -> tuple[Panel, Panel]:
    cascade = axis.cascade
    loops: tuple[tuple[str, OpenLoop, Colour, Dash], ...] = (
        ("velocity loop", cascade.velocity, "green", "dashed"),
        ("position loop", cascade.position, "blue", "solid"),
    )
    sizes, phases, size_marks, phase_marks = [], [], [], []
    for word, loop, colour, dash in loops:
        x = cascade.frequency_hz
        sizes.append(Line(word, x, _db(loop.magnitude), colour, dash=dash))
        phases.append(
            Line(f"phase of the {word}", x, loop.phase_deg, colour, dash=dash, is_named=False)
        )
        margins = loop.margins
        if margins.gain_db is not None and margins.phase_crossover_hz is not None:
            at, gain = margins.phase_crossover_hz, margins.gain_db
            sizes.append(_bar(f"gain margin, {word}", at, (-gain, 0.0), colour))
            size_marks.append(Mark(at, -0.5 * gain, f"{gain:.1f} dB", colour=colour))
        if margins.phase_deg is not None and margins.crossover_hz is not None:
            at, phase = margins.crossover_hz, margins.phase_deg
            phases.append(_bar(f"phase margin, {word}", at, (-180.0, phase - 180.0), colour))
            text = f"{phase:.0f}°"
            phase_marks.append(Mark(at, 0.5 * phase - 180.0, text, colour=colour))
    measured = cascade.measured
    for lines, values, word in (
        (sizes, _db(measured.magnitude), ""),
        (phases, measured.phase_deg, "phase of the "),
    ):
        lines.append(
            Line(
                f"{word}position loop, measured",
                measured.frequency_hz,
                values,
                "ink",
                points=True,
                is_named=not word,
            )
        )
    return (
        Panel(
            x=FREQUENCY,
            y=Axis("magnitude", "dB", least=-50.0, most=50.0),
            lines=tuple(sizes),
            limits=(0.0,),
            marks=tuple(size_marks),
            title=f"{axis.joint}: open loops",
        ),
        Panel(
            x=FREQUENCY,
            y=Axis("phase", "°", least=-300.0, most=0.0),
            lines=tuple(phases),
            limits=(-180.0,),
            marks=tuple(phase_marks),
            height_px=200,
            zooms_with_previous=True,
        ),
    )


def _bar(label: str, at: float, ends: tuple[float, float], colour: Colour) -> Line:
    return Line(label, (at, at), ends, colour, width=3.2, is_named=False)


def _db(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(20.0 * math.log10(each) if each > 1e-9 else SMALLEST_DB for each in values)
