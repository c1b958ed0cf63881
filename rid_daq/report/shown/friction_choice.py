"""`friction_choice_blocks`: the friction terms and the torque channel that `--choose` found."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Column, Heading, Table, Text
from rid_daq.report.sections.comparison import ComparisonSection, MemoryTrial
from rid_daq.report.sections.section import Texts


def friction_choice_blocks(section: ComparisonSection) -> Iterator[AnyBlock]:
    """Yield the chosen terms, what they gain, and what else was found.

    Args:
        section: The choice.
    """
    yield Heading(text="Chosen friction terms", level=3)
    yield Text(
        text="RMS error of moving samples [N m or N] on parts of the runs that each fit left out. A"
        " term is kept only if it is distinct from zero and the error falls by more than its"
        " standard error."
    )
    yield Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="friction terms", is_text=True),
            Column(title="coulomb, viscous"),
            Column(title="chosen"),
            Column(title="Stribeck speed", digits=3),
        ),
        rows=tuple(
            (joint, ", ".join(section.chosen[joint]), plain, chosen, speed)
            for joint, plain, chosen, speed in zip(
                section.joints,
                section.plain,
                section.with_terms,
                section.stribeck_speed,
                strict=True,
            )
        ),
    )
    if section.memory is not None and any(d is not None for d in section.memory.distance):
        yield Text(text="Friction with presliding, judged with standstill and reversal:")
        yield _presliding(section.memory, section.joints)
    for trial in (section.warming, section.channel):
        for sentence in () if trial is None else trial.sentences(section.joints):
            yield Text(text=sentence)


def _presliding(memory: MemoryTrial, joints: Texts) -> Table:
    return Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="RMS error without presliding"),
            Column(title="RMS error with presliding"),
            Column(title="presliding distance, if it is chosen", digits=3),
            Column(title="share of the friction that gives way", digits=2),
        ),
        rows=tuple(
            zip(
                joints,
                memory.without,
                memory.with_memory,
                memory.distance,
                memory.shown_shares,
                strict=True,
            )
        ),
    )
