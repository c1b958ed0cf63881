"""`ClosestApproaches`: smallest distance of two solids in each interval of a motion."""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from config.arrays import FloatArray, IntArray
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.kinematics import link_transforms

ROWS_AT_ONCE: Final = 5000
"""Number of samples whose kinematics are computed together; more if an interval is longer."""


class ClosestApproaches(NamedTuple):
    """The nearest two solids in each interval of a motion.

    Attributes:
        distance_m: Shape (intervals,). Smallest distance of all pairs in all samples of the
            interval [m]; negative if two solids overlap.
        pair: Shape (intervals,). Number of the nearest pair in `Clearances.pairs`.
        row: Shape (intervals,). Sample with the smallest distance.
    """

    distance_m: FloatArray
    pair: IntArray
    row: IntArray


def closest_approaches(clearances: Clearances, q: FloatArray, edges: IntArray) -> ClosestApproaches:
    """Return the nearest two solids in each interval of a motion, over all of its samples.

    A distance is computed only if it can be the smallest one of its interval. It has two lower
    bounds: the distance of the enclosing capsules, and the distance of the same pair in another
    sample minus the travel in between.

    Args:
        clearances: At least one pair of solids.
        q: Shape (samples, n). Joint positions [rad or m].
        edges: Shape (intervals + 1,). Ascending numbers of samples. Interval k has the samples from
            edge k to edge k + 1, with both ends.
    """
    levers = _levers(clearances, q)
    found: list[tuple[float, int, int]] = []
    begin = end = 0
    for first, last in pairwise(edges.tolist()):
        if last >= end:
            begin, end = first, max(last + 1, first + ROWS_AT_ONCE)
            links = link_transforms(clearances.chain, q[begin:end])
            bounds = clearances.lower_bounds(links)
        own = slice(first - begin, last + 1 - begin)
        travel = _travel(levers, q[first : last + 1])
        distance, pair, row = _closest_approach(clearances, links[own], bounds[own].copy(), travel)
        found.append((distance, pair, first + row))
    return ClosestApproaches(*(np.array(column) for column in zip(*found, strict=True)))


def _closest_approach(
    clearances: Clearances, links: FloatArray, bounds: FloatArray, travel: FloatArray
) -> tuple[float, int, int]:
    """Return distance, pair and row of the closest approach in one interval.

    Args:
        clearances: At least one pair of solids.
        links: Shape (samples, n, 4, 4).
        bounds: Shape (samples, pairs). Lower bounds of the distances [m]; they are raised in place.
        travel: Shape (samples, pairs). As returned by `_travel` [m].
    """
    nearest, nearest_pair, nearest_row = np.inf, 0, 0
    while True:
        row, pair = np.divmod(np.argmin(bounds), len(clearances))
        if bounds[row, pair] >= nearest:
            return nearest, int(nearest_pair), int(nearest_row)
        distance = clearances.measure(links, row[np.newaxis], pair[np.newaxis]).distance[0]
        if distance < nearest:
            nearest, nearest_pair, nearest_row = float(distance), pair, row
        reachable = distance - np.abs(travel[:, pair] - travel[row, pair])
        bounds[:, pair] = np.maximum(bounds[:, pair], reachable)
        bounds[row, pair] = np.inf


def _travel(levers: FloatArray, q: FloatArray) -> FloatArray:
    """Return an upper bound of the relative travel of each pair's solids, (samples, pairs) [m].

    The travel is summed from the first sample on. Between two samples, the distance of a pair
    cannot change by more than the difference of the values of these samples.
    """
    moved = np.zeros_like(q)
    moved[1:] = np.abs(np.diff(q, axis=0)).cumsum(axis=0)
    return np.asarray(moved @ levers.T)


def _levers(clearances: Clearances, q: FloatArray) -> FloatArray:
    """Return an upper bound of the relative movement of a pair's solids per joint movement.

    The shape is (pairs, n), the unit m/rad; the bound is 1 for a sliding joint between the solids,
    and 0 for a joint that is not between them.
    """
    chain = clearances.chain
    slide = np.where(chain.prismatic, np.abs(q).max(axis=0), 0.0)
    steps = np.abs(chain.rows[:, 3]) + np.abs(chain.rows[:, 4]) + slide
    # sum of the offsets from the origin of frame i to the last frame
    beyond = np.append(steps[::-1].cumsum()[::-1], 0.0)
    levers = np.zeros((len(clearances), chain.n))
    for number, pair in enumerate(clearances.pairs):
        near, far = sorted(pair, key=lambda solid: solid.link)
        joints = np.arange(near.link, far.link)
        reach = float(np.linalg.norm(far.centre)) + far.reach
        levers[number, joints] = beyond[joints + 1] - beyond[far.link] + reach
    return np.where(chain.prismatic & (levers > 0.0), 1.0, levers)
