"""`loop_blocks`: velocity loops in tables, sentences and plots."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cell, Column, Heading, Interval, Table, Text
from rid_daq.blocks.formats import number, unit
from rid_daq.report.sections.section import Numbers
from rid_daq.report.sections.velocity_loops import AxisLoop, VelocityLoopsSection
from rid_daq.report.shown.bode import bode_plot


def loop_blocks(section: VelocityLoopsSection) -> Iterator[AnyBlock]:
    """Yield controllers, candidates, grades and findings, margins, advice and plots.

    Args:
        section: The loops.
    """
    yield Heading(text="Velocity loops")
    yield Text(text=section.sentence)
    yield _controllers(section)
    yield Text(
        text="p: probability of a misfit as large by noise alone; whiteness: of misfits as alike on"
        " neighbouring lines. Either below 0.001 says that the controller is something else. A"
        " delay and a lag of the same length can hardly be told apart: only their sum counts.",
        is_note=True,
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
    yield _candidates(section)
    yield Heading(text="The whole cascade", level=3)
    yield _margins(section)
    yield Text(
        text="Inertia and damping are apparent ones about the multisine's pose. They serve the"
        " margins and have no interval: stiction and the motion of other joints bias them by 5 to"
        " 20 % in simulation. `identify` estimates inertias. The position loop includes the current"
        " loop's lag, the drive's delay, one cycle of transport and the interpolation. The velocity"
        " loop's phase margin counts from −180°. The position gain K_v is"
        f" {number(section.position_gain_per_s, 3)} 1/s.",
        is_note=True,
    )
    yield Text(text=section.advice)
    for axis in section.axes:
        yield bode_plot(axis)


def _controllers(section: VelocityLoopsSection) -> Table:
    return Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="gain K_p ± 2σ"),
            Column(title="unit", is_text=True),
            Column(title="integral time T_i ± 2σ", unit="ms"),
            Column(title="delay ± 2σ", unit="ms"),
            Column(title="lag ± 2σ", unit="ms"),
            Column(title="p", digits=2),
            Column(title="whiteness", digits=2),
        ),
        rows=tuple(
            (
                axis.joint,
                Interval(value=axis.gain, reach=2.0 * axis.std["gain"]),
                axis.unit,
                Interval(value=1e3 * axis.integral_time_s, reach=2e3 * axis.std["integral_time_s"]),
                _time(axis, "delay", axis.delay_s),
                _time(axis, "lag", axis.lag_s),
                axis.p_value,
                axis.whiteness,
            )
            for axis in section.axes
        ),
    )


def _time(axis: AxisLoop, name: str, value_s: float) -> Cell:
    """Return a delay or lag that was fitted [ms]."""
    if name not in axis.std:
        return "not seen"
    return Interval(value=1e3 * value_s, reach=2e3 * axis.std[name])


def _candidates(section: VelocityLoopsSection) -> Table:
    return Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="terms beside the PI", is_text=True),
            Column(title="cost"),
            Column(title="AIC", digits=5),
            Column(title="MDL", digits=5),
        ),
        rows=tuple(
            (axis.joint, ", ".join(trial.extras) or "none", trial.cost, trial.aic, trial.mdl)
            for axis in section.axes
            for trial in axis.trials
        ),
    )


def _margins(section: VelocityLoopsSection) -> Table:
    return Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="apparent inertia", digits=3),
            Column(title="unit", is_text=True),
            Column(title="apparent damping", digits=3),
            Column(title="unit", is_text=True),
            Column(title="velocity loop: phase margin", is_text=True),
            Column(title="gain margin", is_text=True),
            Column(title="position loop: phase margin", is_text=True),
            Column(title="gain margin", is_text=True),
            Column(title="largest amplification", digits=3),
            Column(title="largest K_v", unit="1/s", digits=3),
        ),
        rows=tuple(
            (
                axis.joint,
                axis.inertia,
                unit(axis.inertia_unit),
                axis.damping,
                axis.unit,
                *axis.velocity_margins.words,
                *axis.position_margins.words,
                axis.position_peak,
                axis.largest_position_gain_per_s,
            )
            for axis in section.axes
        ),
    )


def _distortion(axis: AxisLoop) -> str:
    parts = []
    for kind, found in (("even", axis.response.even), ("odd", axis.response.odd)):
        if found.level:
            level, noise = number(_rms(found.level), 2), number(_rms(found.noise), 2)
            parts.append(f"{kind} {level} (noise {noise})")
    if not parts:
        return "no line was left empty, so distortion is not known"
    return f"distortion [{axis.unit} RMS]: {', '.join(parts)}"


def _rms(values: Numbers) -> float:
    return float((sum(value**2 for value in values) / len(values)) ** 0.5)
