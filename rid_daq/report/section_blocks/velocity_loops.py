"""`loop_blocks`: velocity loops as tables, sentences and plots."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cell, Cells, Heading, Interval, Table, Text, table
from rid_daq.blocks.formats import number, unit
from rid_daq.report.section_blocks.bode import bode_plot
from rid_daq.report.sections.section import Numbers
from rid_daq.report.sections.velocity_loops import AxisLoop, VelocityLoopsSection


def loop_blocks(section: VelocityLoopsSection) -> Iterator[AnyBlock]:
    """Yield controllers, candidates, grades, findings, margins, advice and plots."""
    yield Heading(text="Velocity loops")
    yield Text(text=section.sentence)
    yield _controllers(section)
    yield Text(
        text="p: probability that noise alone causes a misfit at least as large. Whiteness:"
        " probability that noise alone makes the misfits on neighbouring lines at least as"
        " similar. If one of the two is below 0.001 and the misfit is above 1 %, the controller is"
        " not of the fitted structure. A delay and a lag of the same length are nearly"
        " indistinguishable; only their sum is accurate.",
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
    yield Heading(text="Cascade of position and velocity loop", level=3)
    yield _margins(section)
    yield Text(
        text="Inertia and damping are apparent values near the multisine's pose. They are used"
        " for the margins only and have no interval: in simulation, stiction and the motion"
        " of other joints bias them by 5 to 20 %. Use `identify` to estimate inertias. The"
        " position loop includes the current loop's lag, the drive's delay, one cycle of"
        " transport and the interpolation. The velocity loop's phase margin is counted from"
        f" −180°. The position gain K_v is {number(section.position_gain_per_s, 3)} 1/s.",
        is_note=True,
    )
    yield Text(text=section.advice)
    for axis in section.axes:
        yield bode_plot(axis)


def _controllers(section: VelocityLoopsSection) -> Table:
    return table(
        section.axes,
        Cells("joint", lambda axis: axis.joint),
        Cells("gain K_p ± 2σ", lambda axis: Interval.of(axis.gain, axis.std["gain"])),
        Cells("unit", lambda axis: axis.unit),
        Cells("integral time T_i ± 2σ", lambda axis: _ms(axis, "integral_time_s"), "ms"),
        Cells("delay ± 2σ", lambda axis: _ms(axis, "delay_s"), "ms"),
        Cells("lag ± 2σ", lambda axis: _ms(axis, "lag_s"), "ms"),
        Cells("p", lambda axis: axis.p_value, digits=2),
        Cells("whiteness", lambda axis: axis.whiteness, digits=2),
    )


def _ms(axis: AxisLoop, name: str) -> Cell:
    """Return a fitted time constant [ms] with its interval."""
    std = axis.std.get(name, axis.std.get(name.removesuffix("_s")))
    return "not fitted" if std is None else Interval.of(getattr(axis, name), std, 1e3)


def _candidates(section: VelocityLoopsSection) -> Table:
    return table(
        [(axis.joint, trial) for axis in section.axes for trial in axis.trials],
        Cells("joint", lambda each: each[0]),
        Cells("terms in addition to the PI", lambda each: ", ".join(each[1].extras) or "none"),
        Cells("cost", lambda each: each[1].cost),
        Cells("AIC", lambda each: each[1].aic, digits=5),
        Cells("MDL", lambda each: each[1].mdl, digits=5),
    )


def _margins(section: VelocityLoopsSection) -> Table:
    return table(
        section.axes,
        Cells("joint", lambda axis: axis.joint),
        Cells("apparent inertia", lambda axis: axis.inertia, digits=3),
        Cells("unit", lambda axis: unit(axis.inertia_unit)),
        Cells("apparent damping", lambda axis: axis.damping, digits=3),
        Cells("unit", lambda axis: axis.unit),
        Cells("velocity loop: phase margin", lambda axis: axis.velocity_margins.words[0]),
        Cells("gain margin", lambda axis: axis.velocity_margins.words[1]),
        Cells("position loop: phase margin", lambda axis: axis.position_margins.words[0]),
        Cells("gain margin", lambda axis: axis.position_margins.words[1]),
        Cells("largest amplification", lambda axis: axis.position_peak, digits=3),
        Cells("largest K_v", lambda axis: axis.largest_position_gain_per_s, "1/s", 3),
    )


def _distortion(axis: AxisLoop) -> str:
    parts = []
    for kind, found in (("even", axis.response.even), ("odd", axis.response.odd)):
        if found.level:
            level, noise = number(_rms(found.level), 2), number(_rms(found.noise), 2)
            parts.append(f"{kind} {level} (noise {noise})")
    if not parts:
        return "distortion is not known, because every line was excited"
    return f"distortion [{axis.unit} RMS]: {', '.join(parts)}"


def _rms(values: Numbers) -> float:
    return float((sum(value**2 for value in values) / len(values)) ** 0.5)
