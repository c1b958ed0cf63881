"""Choice of each joint's friction terms from the data, by forward selection and elimination.

The joints' equations share the parameters of the links. Every friction term is a column of these
equations. Therefore a model needs only a subset of the entries of one Gram matrix per block: for
its fit, and for its error on a block that was left out of the fit.
- Stribeck friction is tried at a few speeds, each together with the derivative of its curve by the
  speed.
- Load-dependent friction is tried alone and together with Stribeck friction, because each can hide
  the other.
- Shear-thinning friction replaces viscous friction, so it adds only one value, its speed. It is
  tried on each joint, and on all joints at once, because the joints of a robot usually have the
  same kind of gear and lubricant.

A candidate that the data do not identify is skipped. Coulomb and viscous friction alone is always a
possible result.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot.friction_terms import FrictionTerm
from identification.equations.block_grams import (
    PLAIN,
    Fit,
    Grams,
    Terms,
    speeds_of,
    term_of_column,
)
from identification.equations.friction_columns import SPEEDS_RAD_S, THINNING_RAD_S, Column
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
_POSITIVE: Final[tuple[FrictionTerm, ...]] = ("stribeck", "load", "cubic", "shear_thinning")
_SINGLE: Final[tuple[FrictionTerm, ...]] = ("offset", "cubic", "load")
CANDIDATES: Final[tuple[Terms, ...]] = (
    *((name,) for name in _SINGLE),
    *((("stribeck", speed),) for speed in SPEEDS_RAD_S),
    *((("shear_thinning", speed),) for speed in THINNING_RAD_S),
    *(("load", ("stribeck", speed)) for speed in SPEEDS_RAD_S),
)
"""Combinations of terms that are added to those of a joint; shear thinning replaces `viscous`."""
TOGETHER: Final[tuple[Terms, ...]] = (("offset",), ("offset", "cubic", "load"))
"""Terms that are tried on all joints at once.

The joints' equations contain the same links' parameters. Therefore a missing term of one joint
hides those of the others.
"""
BESIDE_THINNING: Final[Terms] = (*PLAIN, "offset", "load")
"""Terms of all joints when shear thinning is tried on all joints; it then replaces `viscous`."""


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
            left = remove_weak_terms(grams, [PLAIN + extra] * n, fit)
            found.append(remove_weak_terms(grams, *_add_terms(grams, *left)))
    found[0] = remove_weak_terms(grams, *found[0])
    thinning = _thinning_of_all_joints(grams)
    if thinning is not None:
        left = remove_weak_terms(grams, *thinning, kept="shear_thinning")
        added = _add_terms(grams, *left)
        found.append(remove_weak_terms(grams, *added, kept="shear_thinning"))
    found.sort(key=lambda own: sum(map(_count, own[0])))
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
        tried = [_with_terms(own, added.get(j, ())) for j, own in enumerate(chosen)]
        richer = _fit_or_none(grams, tried)
        if richer is None:
            break
        chosen, fit, candidates = tried, richer, set(added)
    return chosen, fit


def _thinning_of_all_joints(grams: Grams) -> tuple[list[Terms], Fit] | None:
    """Return terms with shear thinning on all joints at once, and their solution.

    Half a minute of data does not show this term on each joint, but on all joints together. All
    joints get the same speed. If this speed predicts a joint distinctly worse, the joint gets the
    closest speed that does not. The result is None if the held-out error of all joints does not
    clearly fall.
    """
    plain = _fit_or_none(grams, [BESIDE_THINNING] * grams.joints)
    if plain is None:
        return None
    fits = {s: found for s in THINNING_RAD_S if (found := _common_thinning(grams, s)) is not None}
    if not fits:
        return None
    speed = max(fits, key=lambda s: Gain.between(plain.errors, fits[s][1].errors).mean)
    chosen, fit = fits[speed]
    for _ in range(ROUNDS):
        before = list(chosen)
        for j in range(grams.joints):
            chosen, fit = _closest_thinning(grams, chosen, j, speed)
        if chosen == before:
            break
    clear = Gain.between(plain.errors, fit.errors).exceeds(CLEAR_GAIN_SIGMAS, CLEAR_GAIN)
    return (chosen, fit) if clear else None


def _common_thinning(grams: Grams, speed: float) -> tuple[list[Terms], Fit] | None:
    """Return the terms of all joints with shear thinning at a common speed, and their fit.

    A joint whose friction would then drive gets `BESIDE_THINNING` instead. None if the data do not
    identify the terms.
    """
    thin = _terms_with_thinning(speed)
    chosen = [thin] * grams.joints
    while (fit := _fit_or_none(grams, chosen)) is not None:
        driving = [j for j, own in enumerate(chosen) if own == thin and not _is_braking(fit, j)]
        if not driving:
            return chosen, fit
        chosen = [BESIDE_THINNING if j in driving else own for j, own in enumerate(chosen)]
    return None


def _closest_thinning(
    grams: Grams, chosen: list[Terms], joint: int, speed: float
) -> tuple[list[Terms], Fit]:
    """Return the terms with the best speed of one joint's shear thinning, and their solution.

    Of the speeds that do not predict the joint distinctly worse than the best, the one closest to
    `speed` is used. Viscous friction counts as an infinite speed.
    """
    trials = []
    for other in (*THINNING_RAD_S, None):
        own = BESIDE_THINNING if other is None else _terms_with_thinning(other)
        tried = [own if j == joint else terms for j, terms in enumerate(chosen)]
        fit = _fit_or_none(grams, tried)
        if fit is not None and (other is None or _is_braking(fit, joint)):
            away = math.inf if other is None else abs(math.log(other / speed))
            trials.append((away, tried, fit))
    trials.sort(key=lambda trial: trial[0])
    _, tried, fit = trials[simplest_model([fit.errors[:, joint] for _, _, fit in trials])]
    return tried, fit


def _terms_with_thinning(speed: float) -> Terms:
    """Return `BESIDE_THINNING` and shear thinning at `speed`, instead of viscous friction."""
    return _with_terms(BESIDE_THINNING, (("shear_thinning", speed),))


def remove_weak_terms(
    grams: Grams, start: Sequence[Terms], fit: Fit, kept: FrictionTerm | None = None
) -> tuple[list[Terms], Fit]:
    """Return the terms after removing those that do not improve the fit, and their solution.

    Args:
        kept: Term that all joints have, which is not removed. If it is given, the other terms are
            removed, the weakest first, until the held-out error of all joints together grows
            distinctly. All joints count, because a term of one joint also lowers the errors of the
            other joints through the links' parameters. A term within `CLEAR_SIGMAS` of zero, or
            with the wrong sign, is always removed.
    """
    chosen, first = list(start), fit
    while (worst := _weakest_term(grams, chosen, fit, kept)) is not None:
        j, term = worst
        fewer: list[Terms] = [
            _without_term(own, term) if k == j else own for k, own in enumerate(chosen)
        ]
        left = grams.fit(fewer)
        if (
            kept is not None
            and _is_possible(fit, j, term)
            and Gain.between(left.errors, first.errors).exceeds()
        ):
            break
        chosen, fit = fewer, left
    return chosen, fit


def _with_terms(own: Terms, extra: Terms) -> Terms:
    """Return a joint's terms with `extra` ones; shear thinning replaces viscous friction."""
    thin: Column = "viscous"
    for term in extra:
        if term_of_column(term) == "shear_thinning":
            thin = term
    return (
        *(thin if term == "viscous" else term for term in own),
        *(term for term in extra if term != thin),
    )


def _without_term(own: Terms, left: Column) -> Terms:
    """Return a joint's terms without one; viscous friction replaces removed shear thinning."""
    if term_of_column(left) == "shear_thinning":
        return tuple("viscous" if term == left else term for term in own)
    return tuple(term for term in own if term != left)


def _count(own: Terms) -> int:
    """Return the number of a joint's terms; the speed of shear thinning counts as one more."""
    return len(own) + len(speeds_of(own, "shear_thinning"))


def _fit_or_none(grams: Grams, chosen: Sequence[Terms]) -> Fit | None:
    try:
        return grams.fit(chosen)
    except np.linalg.LinAlgError:
        return None


def _candidate_fits(
    grams: Grams, chosen: Sequence[Terms], joint: int
) -> Iterator[tuple[Terms, list[Terms], Fit]]:
    """Yield each identifiable addition to a joint's terms, with all joints' terms and their fit."""
    have = {term_of_column(term) for term in chosen[joint]}
    for extra in CANDIDATES:
        if have.isdisjoint(map(term_of_column, extra)):
            tried = [_with_terms(own, extra) if j == joint else own for j, own in enumerate(chosen)]
            fit = _fit_or_none(grams, tried)
            if fit is not None:
                yield extra, tried, fit


def _best_addition(grams: Grams, chosen: Sequence[Terms], joint: int, now: Fit) -> Terms:
    """Return the terms to add to a joint, as few as are not worse than the best; () for none."""
    good = []
    for extra, tried, fit in _candidate_fits(grams, chosen, joint):
        found = Gain.between(now.errors[:, joint], fit.errors[:, joint])
        if (
            found.exceeds(least=LEAST_GAIN * len(extra))
            and _is_braking(fit, joint)
            and all(_is_distinct(grams, tried, joint, term, fit, found) for term in extra)
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
    """Return True if Coulomb and viscous or shear-thinning friction oppose the motion.

    Otherwise other terms would take over their effect.
    """
    return all(
        fit.value(j, column) > 0.0
        for j, column in fit.places
        if j == joint and (column in PLAIN or term_of_column(column) == "shear_thinning")
    )


def _is_possible(fit: Fit, joint: int, term: Column) -> bool:
    """Return True if a term's 95 % interval excludes zero, on the positive side if required."""
    sigmas = fit.sigmas_from_zero(joint, term)
    return (sigmas if term_of_column(term) in _POSITIVE else abs(sigmas)) > CLEAR_SIGMAS


def _is_distinct(
    grams: Grams, chosen: Sequence[Terms], joint: int, term: Column, fit: Fit, gain: Gain
) -> bool:
    """Return True if a coefficient clearly differs from zero, and is positive if required.

    The limit is `DISTINCT_SIGMAS` standard deviations. Short recordings (half a minute) have wide
    intervals, so it is only `CLEAR_SIGMAS` for a term that clearly reduces the error on held-out
    data. The coefficient of shear thinning is tested in a model that also has viscous friction.
    """
    if term_of_column(term) == "shear_thinning":
        beside: list[Terms] = [
            (*own, "viscous") if j == joint else own for j, own in enumerate(chosen)
        ]
        both = _fit_or_none(grams, beside)
        if both is None:
            return False
        fit = both
    if not _is_possible(fit, joint, term):
        return False
    clear = gain.exceeds(CLEAR_GAIN_SIGMAS, CLEAR_GAIN)
    return clear or abs(fit.sigmas_from_zero(joint, term)) > DISTINCT_SIGMAS


def _weakest_term(
    grams: Grams, chosen: Sequence[Terms], now: Fit, kept: FrictionTerm | None
) -> tuple[int, Column] | None:
    """Return the term closest to zero among those that do not improve the fit.

    Terms of the wrong sign come first.
    """
    weak: list[tuple[bool, float, int, Column]] = []
    for j, own in enumerate(chosen):
        for term in own:
            if term in PLAIN or term_of_column(term) == kept:
                continue
            left = _without_term(own, term)
            fit = grams.fit([*chosen[:j], left, *chosen[j + 1 :]])
            gain = Gain.between(fit.errors[:, j], now.errors[:, j])
            if not (gain.exceeds() and _is_distinct(grams, chosen, j, term, now, gain)):
                weak.append(
                    (_is_possible(now, j, term), abs(now.sigmas_from_zero(j, term)), j, term)
                )
    if not weak:
        return None
    *_, j, term = min(weak, key=lambda each: each[:2])
    return j, term
