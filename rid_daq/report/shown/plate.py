"""Blocks of a force plate: its zero, its fit, and the reaction on the base."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Column, Heading, Interval, Table, Text
from rid_daq.blocks.formats import unit
from rid_daq.report.sections.plate import ImprovementSection, PlateSection
from rid_daq.report.sections.plate_zero import PlateZeroSection
from rid_daq.report.sections.reaction import BaseLoadSection, ReactionSection


def plate_zero_blocks(section: PlateZeroSection) -> Iterator[AnyBlock]:
    """Yield offset and drift of each channel of a force plate.

    Args:
        section: The zero.
    """
    yield Heading(text="Zero of the force plate")
    for sentence in section.sentences:
        yield Text(text=sentence)
    yield Table(
        columns=(
            Column(title="channel", is_text=True),
            Column(title="offset ± 2σ", unit="N"),
            Column(title="drift ± 2σ", unit="mN/s"),
        ),
        rows=tuple(
            (
                each.name,
                Interval(value=each.offset_n, reach=2.0 * each.offset_std_n),
                Interval(value=1e3 * each.drift_n_s, reach=2e3 * each.drift_std_n_s),
            )
            for each in section.channels
        ),
    )


def plate_blocks(section: PlateSection) -> Iterator[AnyBlock]:
    """Yield how a force plate fits an estimate, and what it improved.

    Args:
        section: The fit.
    """
    yield Heading(text="Force plate", level=3)
    for sentence in section.sentences:
        yield Text(text=sentence)
    yield Table(
        columns=(
            Column(title="component", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="residual (RMS)"),
            Column(title="residual / component", unit="%", digits=3),
            Column(title="noise"),
            Column(title="fit", is_text=True),
        ),
        rows=tuple(
            (each.name, each.unit, each.residual, each.percent, each.noise, each.grade or "–")
            for each in section.components
        ),
        failed=tuple(each.grade is Grade.BAD for each in section.components),
    )
    if section.improvement is not None:
        yield Text(text="Standard deviations by the measured noise, with torques, plate, and both:")
        yield _improvement(section.improvement)


def _improvement(section: ImprovementSection) -> Table:
    return Table(
        columns=(
            Column(title="parameter", is_text=True),
            Column(title="estimate ± 2σ by both"),
            Column(title="unit", is_text=True),
            Column(title="σ by torques", digits=2),
            Column(title="σ by plate", digits=2),
            Column(title="σ by both", digits=2),
        ),
        rows=tuple(
            (
                each.words,
                Interval(value=each.value, reach=2.0 * each.std_combined),
                unit(each.unit),
                each.std_internal,
                each.std_external,
                each.std_combined,
            )
            for each in section.parameters
        ),
    )


def reaction_blocks(section: ReactionSection) -> Iterator[AnyBlock]:
    """Yield the errors of a predicted base wrench.

    Args:
        section: The errors.
    """
    yield Heading(text="Reaction on the base")
    yield Text(text=section.sentence)
    yield Table(
        columns=(
            Column(title="reaction", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="RMS error", digits=3),
            Column(title="relative error", unit="%", digits=3),
            Column(title="noise", digits=3),
        ),
        rows=tuple(
            (each.name, each.unit, each.rms_error, each.relative_error_percent, each.noise)
            for each in section.components
        ),
    )


def base_load_blocks(section: BaseLoadSection) -> Iterator[AnyBlock]:
    """Yield the largest reaction of a motion and its limits.

    Args:
        section: The reaction.
    """
    yield Heading(text="Load on the floor")
    yield Text(text=section.sentence)
    yield Table(
        columns=(
            Column(title="reaction", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="largest ± 2σ"),
            Column(title="at", unit="s"),
            Column(title="limit"),
            Column(title="holds", is_text=True),
        ),
        rows=tuple(
            (
                each.name,
                each.unit,
                Interval(value=each.peak, reach=2.0 * each.std),
                each.at_s,
                each.limit,
                "yes" if each.held else "NO",
            )
            for each in section.components
        ),
        failed=tuple(not each.held for each in section.components),
    )
