"""`VerdictSection`: the verdict on a result, with the limits that it was compared with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from rid_daq.report.sections.section import Section

Relation = Literal["≤", "≥"]


class VerdictCheck(Section):
    """Comparison of one value with its limit.

    Attributes:
        text: Name of the quantity.
        value: The value that was reached, in `unit`.
        limit: The limit, in `unit`.
        relation: Required relation of `value` to `limit`: ≤ or ≥.
        unit: Unit of value and limit; empty if they have no unit.
        passed: True if the value satisfies the relation.
    """

    text: str
    value: float
    relation: Relation
    limit: float
    unit: str
    passed: bool

    @classmethod
    def of(
        cls, text: str, value: float, relation: Relation, limit: float, unit: str = ""
    ) -> VerdictCheck:
        """Return the comparison of a value with its limit."""
        passed = value <= limit if relation == "≤" else value >= limit
        return cls(
            text=text,
            value=float(value),
            relation=relation,
            limit=float(limit),
            unit=unit,
            passed=bool(passed),
        )


class VerdictSection(Section):
    """Verdict on a result: passed, failed, or not judged.

    Attributes:
        passed: True if all limits are satisfied; null if there was no limit to compare with.
        headline: The verdict in one line.
        sentence: Additional information on the verdict.
        checks: The values that were compared with limits.
    """

    passed: bool | None
    headline: str
    sentence: str
    checks: tuple[VerdictCheck, ...]

    @classmethod
    def of(cls, checks: Sequence[VerdictCheck], headline: str, sentence: str) -> VerdictSection:
        """Return a verdict from its checks: passed if all checks passed."""
        passed = all(line.passed for line in checks) if checks else None
        return cls(passed=passed, headline=headline, sentence=sentence, checks=tuple(checks))

    @property
    def word(self) -> Literal["passed", "failed", "not judged"]:
        """The verdict in a word, for lists."""
        if self.passed is None:
            return "not judged"
        return "passed" if self.passed else "failed"

    @classmethod
    def failed(cls, headline: str, sentence: str) -> VerdictSection:
        """Return a failed verdict without checks, for example after a motion was stopped."""
        return cls(passed=False, headline=headline, sentence=sentence, checks=())
