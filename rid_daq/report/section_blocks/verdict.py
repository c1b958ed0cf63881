"""`verdict_blocks`: a verdict with its limits; `doubt_texts`: reasons for poor grades."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cells, Table, Text, table
from rid_daq.blocks.block import Verdict as VerdictBlock
from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import GradedAxis
from rid_daq.report.sections.verdict import VerdictSection


def verdict_blocks(verdict: VerdictSection) -> Iterator[AnyBlock]:
    """Yield a verdict, its sentence, and the table of its checks."""
    yield VerdictBlock(passed=verdict.passed, text=verdict.headline)
    yield Text(text=verdict.sentence)
    yield from check_tables(verdict)


def check_tables(verdict: VerdictSection) -> Iterator[Table]:
    """Yield the table of values and their limits, if the verdict has any."""
    if verdict.checks:
        yield table(
            verdict.checks,
            Cells("Quantity", lambda check: check.text),
            Cells("reached", lambda check: f"{number(check.value)} {check.unit}"),
            Cells("required", lambda of: f"{of.relation} {number(of.limit)} {of.unit}"),
            Cells("holds", lambda check: yes_or_no(check.passed)),
            failed=lambda check: not check.passed,
        )


def yes_or_no(holds: bool | None) -> str:
    """Return "yes", "NO", or a dash for None."""
    return {None: "–", True: "yes", False: "NO"}[holds]


def doubt_texts(axes: Iterable[GradedAxis]) -> Iterator[Text]:
    """Yield the reason for the grade of each axis whose fit is not good."""
    for axis in axes:
        if axis.grade not in (None, Grade.GOOD):
            yield Text(text=f"{axis.joint}: the fit is {axis.grade}, {axis.reason}.")
