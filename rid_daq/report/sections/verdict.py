"""`VerdictSection`: what a result is held to, and whether it holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from rid_daq.report.sections.section import Section

Relation = Literal["≤", "≥"]


class VerdictCheck(Section):
    """One line of a verdict: what was reached, and what was required.

    Attributes:
        text: What is held to a limit.
        value, limit: Reached and required, in `unit`.
        relation: How `value` must stand to `limit`.
        unit: Of both; empty where they have none.
        passed: Whether it does.
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
        """Return a value held to a limit."""
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
    """Passed, failed, or neither where nothing was to be judged.

    Attributes:
        passed: None where there was no limit.
        headline: What matters, in a line.
        sentence: What else is to be said.
        checks: What was held to a limit.
    """

    passed: bool | None
    headline: str
    sentence: str
    checks: tuple[VerdictCheck, ...]

    @classmethod
    def of(cls, checks: Sequence[VerdictCheck], headline: str, sentence: str) -> VerdictSection:
        """Return the verdict of some checks: passed where all of them are."""
        passed = all(line.passed for line in checks) if checks else None
        return cls(passed=passed, headline=headline, sentence=sentence, checks=tuple(checks))

    @classmethod
    def failed(cls, headline: str, sentence: str) -> VerdictSection:
        """Return a verdict that failed without a limit, such as a motion that was stopped."""
        return cls(passed=False, headline=headline, sentence=sentence, checks=())
