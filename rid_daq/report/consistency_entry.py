"""`ConsistencyEntry`: the test of physical consistency as a part of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rid_daq.report.sections.section import Section

if TYPE_CHECKING:
    from identification.consistency.consistency_test import ConsistencyTest


class ViolationEntry(Section):
    """A parameter that is never negative for a real robot, but whose estimate is below zero.

    Attributes:
        name: Name of the parameter.
        expression: The parameter as a combination of standard parameters.
        sigmas: Distance of the estimate below zero [standard deviations].
        p_value: Probability of such an estimate if the true value is zero, corrected for the number
            of tested parameters (Holm).
    """

    name: str
    expression: str
    sigmas: float
    p_value: float


class ConsistencyEntry(Section):
    """Result of the test of physical consistency.

    Attributes:
        consistent: False if the data refute every consistent robot at p = 0.05.
        p_value: p-value of the two statistics together: the largest single violation, and the
            distance.
        single_p_value: p-value of the largest single violation.
        distance_p_value: p-value of the squared distance from the nearest consistent robot; null if
            a single violation already refutes consistency.
        distance: Distance from the nearest consistent robot, in decorrelated standard deviations;
            null if a single violation already refutes consistency.
        tested: Number of parameters that cannot be negative.
        largest: The largest single violation; null if no tested estimate is below zero.
        violations: All tested estimates below zero, the largest violation first.
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
        """Return the entry of a test."""
        entries = tuple(ViolationEntry.from_attributes(each) for each in test.violations)
        return cls.from_attributes(
            test,
            consistent=test.is_consistent,
            largest=entries[0] if entries else None,
            violations=entries,
        )
