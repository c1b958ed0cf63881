"""Blocks of a force plate: its offsets, its fit, and the base wrench."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cells, Heading, Interval, Table, Text, table
from rid_daq.blocks.formats import unit
from rid_daq.report.section_blocks.verdict import yes_or_no
from rid_daq.report.sections.plate import (
    BaseLoadSection,
    ImprovementSection,
    PlateSection,
    ReactionSection,
)
from rid_daq.report.sections.plate_zero import PlateZeroSection


def plate_zero_blocks(section: PlateZeroSection) -> Iterator[AnyBlock]:
    """Yield offset and drift of each channel of a force plate."""
    yield Heading(text="Offsets of the force plate")
    for sentence in section.sentences:
        yield Text(text=sentence)
    yield table(
        section.channels,
        Cells("channel", lambda each: each.name),
        Cells(
            "offset ± 2σ",
            lambda each: Interval.of(each.offset_n, each.offset_std_n),
            "N",
        ),
        Cells(
            "drift ± 2σ",
            lambda each: Interval.of(each.drift_n_s, each.drift_std_n_s, 1e3),
            "mN/s",
        ),
    )


def plate_blocks(section: PlateSection) -> Iterator[AnyBlock]:
    """Yield the fit of a force plate's signals, and the improvement of the parameters."""
    yield Heading(text="Force plate", level=3)
    for sentence in section.sentences:
        yield Text(text=sentence)
    yield table(
        section.components,
        Cells("component", lambda each: each.name),
        Cells("unit", lambda each: each.unit),
        Cells("residual (RMS)", lambda each: each.residual),
        Cells("residual / component", lambda each: each.percent, "%", 3),
        Cells("noise", lambda each: each.noise),
        Cells("fit", lambda each: each.grade or "–"),
        failed=lambda each: each.grade is Grade.BAD,
    )
    if section.improvement is not None:
        yield Text(
            text="Standard deviations due to the measured noise, if the parameters are estimated"
            " from torques, from the plate, or from both:"
        )
        yield _improvement(section.improvement)


def _improvement(section: ImprovementSection) -> Table:
    return table(
        section.parameters,
        Cells("parameter", lambda each: each.words),
        Cells(
            "estimate ± 2σ from both",
            lambda each: Interval.of(each.value, each.std_combined),
        ),
        Cells("unit", lambda each: unit(each.unit)),
        Cells("σ from torques", lambda each: each.std_internal, digits=2),
        Cells("σ from the plate", lambda each: each.std_external, digits=2),
        Cells("σ from both", lambda each: each.std_combined, digits=2),
    )


def reaction_blocks(section: ReactionSection) -> Iterator[AnyBlock]:
    """Yield the errors of a predicted base wrench."""
    yield Heading(text="Base wrench")
    yield Text(text=section.sentence)
    yield table(
        section.components,
        Cells("component", lambda each: each.name),
        Cells("unit", lambda each: each.unit),
        Cells("RMS error", lambda each: each.rms_error, digits=3),
        Cells("relative error", lambda each: each.relative_error_percent, "%", 3),
        Cells("limit", lambda each: each.limit_percent, "%", 3),
        Cells("noise", lambda each: each.noise, digits=3),
    )


def base_load_blocks(section: BaseLoadSection) -> Iterator[AnyBlock]:
    """Yield the largest base wrench of a motion and its limits."""
    yield Heading(text="Load on the floor")
    yield Text(text=section.sentence)
    yield table(
        section.components,
        Cells("component", lambda each: each.name),
        Cells("unit", lambda each: each.unit),
        Cells("largest ± 2σ", lambda each: Interval.of(each.peak, each.std)),
        Cells("at", lambda each: each.at_s, "s"),
        Cells("limit", lambda each: each.limit),
        Cells("holds", lambda each: yes_or_no(each.held)),
        failed=lambda each: not each.held,
    )
