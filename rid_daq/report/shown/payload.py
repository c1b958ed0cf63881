"""`payload_blocks`: what people see of a payload."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Column, Heading, Interval, Table, Text
from rid_daq.blocks.formats import measured, number, unit
from rid_daq.report.sections.payload import PayloadParameter, PayloadSection
from rid_daq.report.shown.centre_of_gravity import CentreOfGravity, centre_plot


def payload_blocks(section: PayloadSection) -> Iterator[AnyBlock]:
    """Yield parameters with intervals, principal moments, findings, and the fit of each axis.

    Args:
        section: The payload.
    """
    yield Heading(text="Payload")
    yield Text(text=section.sentence)
    yield _parameters(section)
    yield Text(
        text="Centre of gravity (cx, cy, cz) from the flange's origin, inertia about it, in the"
        " axes of the flange: the robot file's tool frame. Ixy is the element of the matrix,"
        " −∫ x y dm.",
        is_note=True,
    )
    if section.has_centre:
        yield centre_plot(CentreOfGravity.of_section(section))
    if section.principal is not None:
        moments = "; ".join(
            f"{number(each.moment)} kg m² about ({', '.join(f'{x:.3f}' for x in each.axis)})"
            for each in section.principal
        )
        yield Text(text=f"{section.existence} Principal moments: {moments}.")
    if section.repeats is not None:
        scatter, ratio = section.repeats.scatter[0], section.repeats.ratio
        yield Text(
            text=f"{section.repeats.runs} runs, each for itself: the mass scatters by"
            f" {number(scatter, 2)} kg (1σ). Scatter over quoted standard deviation, all ten"
            f" parameters together: {number(ratio, 2)}."
        )
    for finding in section.findings:
        yield Text(text=finding)
    yield _axes(section)


def _parameters(section: PayloadSection) -> Table:
    return Table(
        columns=(
            Column(title="parameter", is_text=True),
            Column(title="estimate ± 2σ"),
            Column(title="σ by noise", digits=2),
            Column(title="unit", is_text=True),
            Column(title="consistent body"),
            Column(title="", is_text=True),
        ),
        rows=tuple(
            (
                each.name,
                "not seen"
                if each.value is None or each.std is None
                else Interval(value=each.value, reach=2.0 * each.std),
                each.std_noise,
                unit(each.unit),
                _exported(each),
                "known" if each.known else "",
            )
            for each in section.parameters
        ),
    )


def _exported(parameter: PayloadParameter) -> str | None:
    """Return the value of the consistent body with the digits of the estimate."""
    if parameter.exported is None or parameter.std is None:
        return None
    return measured(parameter.exported, 2.0 * parameter.std)[0]


def _axes(section: PayloadSection) -> Table:
    return Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="torque of the payload (RMS)", digits=3),
            Column(title="residual (RMS)", digits=3),
            Column(title="of the torque", unit="%", digits=3),
            Column(title="times the noise", digits=2),
            Column(title="fit", is_text=True),
            Column(title="reason", is_text=True),
            Column(title="mass per 1 % of torque", unit="kg", digits=2),
        ),
        rows=tuple(
            (
                axis.joint,
                axis.unit,
                axis.payload,
                axis.residual,
                axis.residual_percent,
                axis.over_noise,
                axis.grade or "–",
                axis.reason,
                axis.mass_per_percent,
            )
            for axis in section.axes
        ),
        failed=tuple(axis.grade is Grade.BAD for axis in section.axes),
    )
