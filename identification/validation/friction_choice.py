"""Choice of each joint's friction terms from the data, by forward selection and elimination.

The joints' equations share the parameters of the links. Candidates are columns of these equations.
Every model therefore uses a subset of the entries of one Gram matrix per block, both for its fit
and for its error on a block that was left out of the fit. Stribeck friction is tried at a few
speeds, each together with the derivative of its curve by the speed. Load-dependent friction is
tried alone and together with Stribeck friction, because each can hide the other. Terms that are
nonlinear in the speed are combined for the same reason. A candidate that the data do not identify
is skipped; Coulomb and viscous friction alone is always a result.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot.friction_terms import FrictionTerm
from identification.equations.block_grams import PLAIN, Fit, Grams, Terms, term_of_column
from identification.equations.friction_columns import SPEEDS_RAD_S, Column
from identification.regression.nested_choice import (
    DISTINCT_SIGMAS,
    LEAST_GAIN,
    Gain,
    simplest_model,
)

ROUNDS: Final = 4
CLEAR_SIGMAS: Final = 2.0
CLEAR_GAIN: Final = 0.1
CLEAR_GAIN_SIGMAS: Final = 3.0
_POSITIVE: Final[tuple[FrictionTerm, ...]] = ("stribeck", "load")
_SINGLE: Final[tuple[FrictionTerm, ...]] = ("offset", "cubic", "cube_root", "load")
CANDIDATES: Final[tuple[Terms, ...]] = (
    *((name,) for name in _SINGLE),
    *((("stribeck", speed),) for speed in SPEEDS_RAD_S),
    ("cubic", "cube_root"),
    *((name, ("stribeck", speed)) for name in ("load", "cube_root") for speed in SPEEDS_RAD_S),
)
"""Combinations of terms that are tried in addition to those of a joint."""
TOGETHER: Final[tuple[Terms, ...]] = (
    ("offset",), ("offset", "cubic", "load"), ("offset", "cube_root", "load"),
)  # fmt: skip
"""Terms that are tried on all joints at once.

Joints share the links' parameters, so that a missing term of one joint hides those of the others.
"""


@dataclass(frozen=True, eq=False)
class FrictionChoice:
    """The chosen terms of each joint.

    Attributes:
        terms: Friction terms of each joint.
        fit, plain: Solutions with these terms, and with Coulomb and viscous friction alone.
    """

    terms: tuple[Terms, ...]
    fit: Fit
    plain: Fit


def choose_terms(grams: Grams) -> FrictionChoice:
    """Choose each joint's friction terms.

    Args:
        grams: The equations, with the torque channel applied.
    """
    n = grams.joints
    plain = grams.fit([PLAIN] * n)
    found = [_add_terms(grams, [PLAIN] * n, plain)]
    for extra in TOGETHER:
        fit = _fit_or_none(grams, [PLAIN + extra] * n)
        if fit is not None and Gain.between(plain.errors, fit.errors).exceeds():
            left = _remove_weak_terms(grams, [PLAIN + extra] * n, fit)
            found.append(_remove_weak_terms(grams, *_add_terms(grams, *left)))
    found[0] = _remove_weak_terms(grams, *found[0])
    found.sort(key=lambda own: sum(map(len, own[0])))
    chosen, now = found[simplest_model([fit.errors for _, fit in found])]
    # A joint whose error grew returns to Coulomb and viscous friction.
    worse = [j for j in range(n) if np.nanmean(now.errors[:, j]) > np.nanmean(plain.errors[:, j])]
    if any(chosen[j] != PLAIN for j in worse):
        chosen = [PLAIN if j in worse else own for j, own in enumerate(chosen)]
        now = grams.fit(chosen)
    return FrictionChoice(tuple(chosen), now, plain)


def _add_terms(grams: Grams, start: Sequence[Terms], fit: Fit) -> tuple[list[Terms], Fit]:
    """Return the terms after adding those that improve the fit, and their solution."""
    chosen, candidates = list(start), set(range(grams.joints))
    for _ in range(ROUNDS):
        added = {
            j: extra for j in sorted(candidates) if (extra := _best_addition(grams, chosen, j, fit))
        }
        if not added:
            break
        tried = [own + added.get(j, ()) for j, own in enumerate(chosen)]
        richer = _fit_or_none(grams, tried)
        if richer is None:
            break
        chosen, fit, candidates = tried, richer, set(added)
    return chosen, fit


def _remove_weak_terms(grams: Grams, start: Sequence[Terms], fit: Fit) -> tuple[list[Terms], Fit]:
    """Return the terms after removing those that do not improve the fit, and their solution."""
    chosen = list(start)
    while (worst := _weakest_term(grams, chosen, fit)) is not None:
        j, term = worst
        chosen[j] = tuple(own for own in chosen[j] if own != term)
        fit = grams.fit(chosen)
    return chosen, fit


def _fit_or_none(grams: Grams, chosen: Sequence[Terms]) -> Fit | None:
    try:
        return grams.fit(chosen)
    except np.linalg.LinAlgError:
        return None


def _candidate_fits(
    grams: Grams, chosen: Sequence[Terms], joint: int
) -> Iterator[tuple[Terms, Fit]]:
    """Yield terms that can be added to a joint and that the data identify, with their fit."""
    have = {term_of_column(term) for term in chosen[joint]}
    for extra in CANDIDATES:
        if have.isdisjoint(map(term_of_column, extra)):
            tried = [own + extra if j == joint else own for j, own in enumerate(chosen)]
            fit = _fit_or_none(grams, tried)
            if fit is not None:
                yield extra, fit


def _best_addition(grams: Grams, chosen: Sequence[Terms], joint: int, now: Fit) -> Terms:
    """Return the fewest terms to add to a joint that are not worse than the best; () for none."""
    good = []
    for extra, fit in _candidate_fits(grams, chosen, joint):
        found = Gain.between(now.errors[:, joint], fit.errors[:, joint])
        if (
            _is_braking(fit, joint)
            and all(_is_distinct(fit, joint, term, found) for term in extra)
            and found.exceeds(least=LEAST_GAIN * len(extra))
        ):
            good.append((extra, fit))
    return preferred_terms(good, now, joint) if good else ()


def preferred_terms(trials: Sequence[tuple[Terms, Fit]], now: Fit, joint: int) -> Terms:
    """Return the fewest terms that predict a joint not distinctly worse than the best terms.

    Among equally many terms, those whose coefficients are distinct from zero are preferred; among
    these, those with the smallest error.

    Args:
        trials: Sequence of (terms, fit), at least one. Candidate terms, and the solution with them.
        now: The solution without the candidate terms.
        joint: The joint's index, from 0.
    """

    def gain(trial: tuple[Terms, Fit]) -> float:
        return Gain.between(now.errors[:, joint], trial[1].errors[:, joint]).mean

    ordered = sorted(trials, key=lambda trial: (len(trial[0]), -gain(trial)))
    count = len(ordered[simplest_model([fit.errors[:, joint] for _, fit in ordered])][0])
    fewest = [trial for trial in ordered if len(trial[0]) == count]
    best = fewest[0]
    distinct = [
        (terms, fit)
        for terms, fit in fewest
        if all(abs(fit.sigmas_from_zero(joint, term)) > DISTINCT_SIGMAS for term in terms)
        and not Gain.between(fit.errors[:, joint], best[1].errors[:, joint]).exceeds()
    ]
    return (distinct or fewest)[0][0]


def _is_braking(fit: Fit, joint: int) -> bool:
    """Return True if Coulomb and viscous friction oppose the motion.

    Other terms must not replace them.
    """
    return all(fit.value(joint, term) > 0.0 for term in PLAIN)


def _is_distinct(fit: Fit, joint: int, term: Column, gain: Gain) -> bool:
    """Return True if a term is distinct from zero, and positive if required.

    The limit is lower for a term that clearly reduces the error on held-out data: few blocks, as in
    half a minute of data, give wide intervals.
    """
    if term_of_column(term) in _POSITIVE and fit.value(joint, term) <= 0.0:
        return False
    clear = gain.exceeds(CLEAR_GAIN_SIGMAS, CLEAR_GAIN)
    return abs(fit.sigmas_from_zero(joint, term)) > (CLEAR_SIGMAS if clear else DISTINCT_SIGMAS)


def _weakest_term(grams: Grams, chosen: Sequence[Terms], now: Fit) -> tuple[int, Column] | None:
    """Return the term closest to zero among those that do not improve the fit."""
    weak: list[tuple[float, int, Column]] = []
    for j, own in enumerate(chosen):
        for term in own[len(PLAIN) :]:
            left: Terms = tuple(other for other in own if other != term)
            fit = grams.fit([*chosen[:j], left, *chosen[j + 1 :]])
            gain = Gain.between(fit.errors[:, j], now.errors[:, j])
            if not (_is_distinct(now, j, term, gain) and gain.exceeds()):
                weak.append((abs(now.sigmas_from_zero(j, term)), j, term))
    if not weak:
        return None
    _, j, term = min(weak, key=lambda each: each[0])
    return j, term
