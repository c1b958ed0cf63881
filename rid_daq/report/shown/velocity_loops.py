"""`loop_blocks`: velocity loops in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Column, Interval, Table, Text
from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import Numbers
from rid_daq.report.sections.velocity_loops import AxisLoop, VelocityLoopsSection


def loop_blocks(section: VelocityLoopsSection) -> Iterator[AnyBlock]:
    """Yield controllers, margins, distortion, grades, findings and advice.

    Parameters
    ----------
    section : VelocityLoopsSection
        The loops.
    """
    yield Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="gain ± 2σ"),
            Column(title="unit", is_text=True),
            Column(title="integral time ± 2σ", unit="ms"),
            Column(title="delay + lag", unit="ms", digits=3),
            Column(title="p", digits=2),
            Column(title="p of whiteness", digits=2),
        ),
        rows=tuple(
            (
                axis.joint,
                Interval(value=axis.gain, reach=2.0 * axis.std["gain"]),
                axis.unit,
                Interval(value=1e3 * axis.integral_time_s, reach=2e3 * axis.std["integral_time_s"]),
                1e3 * (axis.delay_s + axis.lag_s),
                axis.p_value,
                axis.whiteness,
            )
            for axis in section.axes
        ),
    )
    yield Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="apparent inertia", digits=3),
            Column(title="unit", is_text=True),
            Column(title="velocity loop: phase margin", is_text=True),
            Column(title="gain margin", is_text=True),
            Column(title="position loop: phase margin", is_text=True),
            Column(title="gain margin", is_text=True),
            Column(title="largest K_v", unit="1/s", digits=3),
        ),
        rows=tuple(
            (
                axis.joint,
                axis.inertia,
                axis.inertia_unit,
                *axis.velocity_margins.words,
                *axis.position_margins.words,
                axis.largest_position_gain_per_s,
            )
            for axis in section.axes
        ),
    )
    for axis in section.axes:
        lines = axis.response.frequency_hz
        yield Text(
            text=f"{axis.joint}: {len(lines)} lines from {lines[0]:.3g} to {lines[-1]:.3g} Hz;"
            f" {_distortion(axis)}."
        )
        if axis.grade is not None:
            yield Text(
                text=f"{axis.joint}: {axis.left_words}; the fit is {axis.grade}, {axis.reason}."
            )
        for finding in axis.findings:
            yield Text(text=f"{axis.joint}: {finding}.")
    yield Text(text=section.advice)


def _distortion(axis: AxisLoop) -> str:
    parts = []
    for kind, found in (("even", axis.response.even), ("odd", axis.response.odd)):
        if found.level:
            level, noise = number(_rms(found.level), 2), number(_rms(found.noise), 2)
            parts.append(f"{kind} {level} (noise {noise})")
    if not parts:
        return "no line was left empty, so distortion is not told"
    return f"distortion [{axis.unit} RMS]: {', '.join(parts)}"


def _rms(values: Numbers) -> float:
    return float((sum(value**2 for value in values) / len(values)) ** 0.5)
