"""`friction_choice_blocks`: the friction terms and the torque channel that `--choose` selected."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, table
from rid_daq.report.sections.comparison import ComparisonSection, MemoryTrial
from rid_daq.report.sections.section import Texts


def friction_choice_blocks(section: ComparisonSection) -> Iterator[AnyBlock]:
    """Yield the selected terms, the errors with and without them, and other findings."""
    yield Heading(text="Chosen friction terms", level=3)
    yield Text(
        text="RMS error of moving samples [N m or N] on parts of the runs that each fit left"
        " out. A term is selected only if it differs from zero and reduces the error by"
        " more than the standard error of this reduction."
    )
    thinning = section.shear_thinning_speed or (None,) * len(section.joints)
    yield table(
        range(len(section.joints)),
        Cells("axis", lambda j: section.joints[j]),
        Cells("friction terms", lambda j: ", ".join(section.chosen[section.joints[j]])),
        Cells("coulomb, viscous", lambda j: section.plain[j]),
        Cells("chosen", lambda j: section.with_terms[j]),
        Cells("Stribeck speed", lambda j: section.stribeck_speed[j], digits=3),
        Cells("shear-thinning speed", lambda j: thinning[j], digits=3),
    )
    if section.memory is not None and any(d is not None for d in section.memory.distance):
        yield Text(
            text="RMS error without and with presliding, on all left-out samples, including"
            " standstill and reversal:"
        )
        yield _presliding(section.memory, section.joints)
    for trial in (section.warming, section.channel):
        for sentence in () if trial is None else trial.sentences(section.joints):
            yield Text(text=sentence)


def _presliding(memory: MemoryTrial, joints: Texts) -> Table:
    return table(
        range(len(joints)),
        Cells("axis", lambda j: joints[j]),
        Cells("RMS error without presliding", lambda j: memory.without[j]),
        Cells("RMS error with presliding", lambda j: memory.with_memory[j]),
        Cells("presliding distance, if selected", lambda j: memory.distance[j], digits=3),
        Cells("presliding fraction of the friction", lambda j: memory.shown_shares[j], digits=2),
    )
