"""`ConsistencyEntry`: the test of physical consistency as a part of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rid_daq.report.sections.section import Section

if TYPE_CHECKING:
    from identification.consistency.consistency_test import ConsistencyTest


class ViolationEntry(Section):
    """A parameter that no real robot has below zero, and that was identified there.

    Attributes:
        name, expression: Its name, and the combination of standard parameters that it is.
        sigmas: Its distance below zero [standard deviations].
        p_value: Probability of such a value if the true one is zero, corrected for the number of
            parameters that were tested (Holm).
    """

    name: str
    expression: str
    sigmas: float
    p_value: float


class ConsistencyEntry(Section):
    """Test of physical consistency.

    Attributes:
        consistent: False if every consistent robot is refuted at p = 0.05.
        p_value: Of the largest single violation and of the distance together.
        single_p_value: Of the largest single violation.
        distance_p_value, distance: Of the squared distance from the nearest consistent robot, and
            that distance in decorrelated standard deviations; None if a single violation refutes
            already.
        tested: Number of parameters that cannot be negative.
        largest: The largest single violation; None if none of them is below zero.
        violations: All of them that are below zero, the largest first.
    """

    consistent: bool
    p_value: float
    single_p_value: float
    distance_p_value: float | None
    distance: float | None
    tested: int
    largest: ViolationEntry | None
    violations: tuple[ViolationEntry, ...]

    @classmethod
    def of(cls, test: ConsistencyTest) -> ConsistencyEntry:
        """Return the result of a test."""
        entries = tuple(ViolationEntry.from_attributes(each) for each in test.violations)
        return cls.from_attributes(
            test,
            consistent=test.is_consistent,
            largest=entries[0] if entries else None,
            violations=entries,
        )
