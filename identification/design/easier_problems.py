"""`easier_problems`: easier design tasks to try if a requested motion has no solution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from identification.design.problem import ExcitationProblem

FEWEST_HARMONICS: Final = 2
SLOWER: Final = (2, 4)


def easier_problems(problem: ExcitationProblem) -> Iterator[tuple[str, ExcitationProblem]]:
    """Yield easier problems with a description: first fewer harmonics, then also longer periods.

    Periods are multiplied by integers, so that they remain a whole number of cycles.
    """
    fewer = max(FEWEST_HARMONICS, problem.harmonics // 2)
    if fewer < problem.harmonics:
        problem = replace(problem, harmonics=fewer)
        yield f"{fewer} harmonics", problem
    for factor in SLOWER:
        period_s = factor * problem.period_s
        words = f"{problem.harmonics} harmonics of {period_s:g} s"
        yield words, replace(problem, period_s=period_s)
