"""`payload_blocks`: texts, tables and plots of an estimated payload."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cells, Heading, Interval, Table, Text, table
from rid_daq.blocks.formats import format_measured, number, unit
from rid_daq.report.section_blocks.centre_of_gravity import CentreOfGravity, centre_plot
from rid_daq.report.sections.payload import PayloadParameter, PayloadSection


def payload_blocks(section: PayloadSection) -> Iterator[AnyBlock]:
    """Yield findings, parameters with intervals, principal moments, and the fit of each axis."""
    yield Heading(text="Payload")
    yield Text(text=section.sentence)
    for finding in section.findings:
        yield Text(text=finding)
    yield _parameters(section)
    yield Text(
        text="Centre of gravity (cx, cy, cz) relative to the flange's origin, inertia about the"
        " centre of gravity, in the axes of the flange (the robot file's tool frame). Ixy"
        " is the element of the matrix, −∫ x y dm.",
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
            text=f"The payload was also estimated from each of {section.repeats.runs} runs alone:"
            f" the mass scatters by {number(scatter, 2)} kg (1σ). Scatter divided by the"
            " quoted standard deviation, for all ten parameters together:"
            f" {number(ratio, 2)}."
        )
    yield _axes(section)


def _parameters(section: PayloadSection) -> Table:
    return table(
        section.parameters,
        Cells("parameter", lambda each: each.name),
        Cells(
            "estimate ± 2σ",
            lambda each: (
                "not identified"
                if each.value is None or each.std is None
                else Interval.of(each.value, each.std)
            ),
        ),
        Cells("σ from noise", lambda each: each.std_noise, digits=2),
        Cells("unit", lambda each: unit(each.unit)),
        Cells("consistent body", _exported_value),
        Cells("", lambda each: "known" if each.known else ""),
    )


def _exported_value(parameter: PayloadParameter) -> str | None:
    """Return a value of the closest consistent body, with as many digits as the estimate."""
    if parameter.exported is None or parameter.std is None:
        return None
    return format_measured(parameter.exported, 2.0 * parameter.std)[0]


def _axes(section: PayloadSection) -> Table:
    return table(
        section.axes,
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("torque of the payload (RMS)", lambda axis: axis.payload, digits=3),
        Cells("residual (RMS)", lambda axis: axis.residual, digits=3),
        Cells("residual / torque", lambda axis: axis.residual_percent, "%", 3),
        Cells("residual / noise", lambda axis: axis.over_noise, digits=2),
        Cells("fit", lambda axis: axis.grade or "–"),
        Cells("reason", lambda axis: axis.reason),
        Cells("change of mass per 1 % of torque", lambda axis: axis.mass_per_percent, "kg", 2),
        failed=lambda axis: axis.grade is Grade.BAD,
    )
