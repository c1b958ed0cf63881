"""`design_poses`: poses whose measured points determine a calibration best (D-optimality)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from identification.kinematics.arm import PlacedArm
from identification.kinematics.calibration import fewest_poses, probe_positions
from identification.kinematics.parameters import (
    KinematicParameter,
    choose_identifiable,
    compliance_candidates,
    geometry_candidates,
)

CANDIDATES: Final = 500
MOST_DRAWS: Final = 20_000
_PASSES: Final = 20
_RIDGE: Final = 1e-6
_CLEAR_STEP: Final = 0.05
"""Step of the collision check between two poses [rad or m]."""


@dataclass(frozen=True, eq=False)
class PoseDesign:
    """Poses to measure, first those without and then those with a load.

    Attributes:
        position: Shape (poses, n). Joint positions [rad or m].
        load_kg: Shape (poses,). Load at the flange.
        point_m: Shape (poses, 3). The nominal point in frame 0.
        parameters: Parameters that these poses determine.
        spread_mean, spread_max: Standard deviation of a calibrated coordinate within the joints'
            ranges, over that of a measured coordinate.
        middle: Shape (n,). A pose from which each pose can be reached on a straight line in joint
            space, clear of obstacles.
    """

    position: FloatArray
    load_kg: FloatArray
    point_m: FloatArray
    parameters: tuple[KinematicParameter, ...]
    spread_mean: float
    spread_max: float
    middle: FloatArray

    def stops(self, rows: BoolArray, clearances: Clearances) -> FloatArray:
        """Return some of the poses in order; if an obstacle is between two, insert the middle pose.

        Args:
            rows: Shape (poses,). True for the poses to visit.
            clearances: Bodies that must stay apart.
        """
        found: list[FloatArray] = []
        for pose in self.position[rows]:
            if found and not is_clear_between(clearances, found[-1], pose):
                found.append(self.middle)
            found.append(pose)
        return np.array(found)


def design_poses(
    arm: PlacedArm,
    robot: RobotDescription,
    clearances: Clearances,
    *,
    count: int,
    load_kg: float = 0.0,
    range_fraction: float = 0.9,
    seed: int = 0,
) -> PoseDesign:
    """Choose poses from random ones by the determinant of the information matrix.

    Args:
        arm: The nominal arm.
        robot: Limits of the joints; if the gravity of the arm is known, also of the torques.
        clearances: Bodies that must stay apart, in the poses and on the way to them.
        count: Number of poses.
        load_kg: Known load that half of the poses carry; 0 for none.
        range_fraction: Fraction of each joint's range, around its middle, in which poses are drawn.
        seed: Random seed of the poses.

    Raises:
        ConfigError: Too few random poses are within the limits and clear of obstacles.
        DataQualityError: `count` is too small for the parameters.
    """
    middle, drawn = _usable_poses(arm, robot, clearances, load_kg, range_fraction, seed)
    candidates = (
        *geometry_candidates(arm.chain, robot.joint_names),
        *(compliance_candidates(arm.chain, robot.joint_names) if arm.gravity else ()),
    )
    loads = (0.0, load_kg) if load_kg else (0.0,)
    position = np.concatenate([drawn] * len(loads))
    carried = np.repeat(loads, len(drawn))
    parameters = choose_identifiable(arm.slopes(position, carried, candidates), candidates)
    if count < fewest_poses(len(parameters)):
        raise DataQualityError(
            f"{count} poses are too few for {len(parameters)} parameters of robot {robot.name!r}:"
            f" at least {fewest_poses(len(parameters))} are needed, and"
            f" {2 * fewest_poses(len(parameters))} are better",
            code="RID-KINEMATICS-FEW",
        )
    slopes = arm.slopes(position, carried, parameters)
    scaled = slopes / np.linalg.norm(slopes.reshape(-1, len(parameters)), axis=0)
    is_loaded = carried > 0.0
    quota = (count - count // 2, count // 2) if load_kg else (count, 0)
    chosen = _choose(scaled, is_loaded, quota)
    information = np.einsum("kip,kiq->pq", scaled[chosen], scaled[chosen])
    probes = probe_positions(robot)
    at_probes = arm.slopes(probes, np.zeros(len(probes)), parameters)
    at_probes = at_probes / np.linalg.norm(slopes.reshape(-1, len(parameters)), axis=0)
    spread = np.sqrt(np.einsum("sip,pq,siq->si", at_probes, np.linalg.inv(information), at_probes))
    order = [
        row
        for loaded in (False, True)
        for row in _short_way(position, [k for k in chosen if is_loaded[k] == loaded], middle)
    ]
    return PoseDesign(
        position[order],
        carried[order],
        arm.points(position[order], carried[order]),
        parameters,
        float(spread.mean()),
        float(spread.max()),
        middle,
    )


def is_clear_between(clearances: Clearances, start: FloatArray, end: FloatArray) -> bool:
    """Return True if bodies stay apart on the straight line in joint space between two poses."""
    if len(clearances) == 0:
        return True
    steps = max(1, math.ceil(float(np.abs(end - start).max()) / _CLEAR_STEP))
    share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
    return clearances.is_clear(start + share * (end - start))


def _usable_poses(
    arm: PlacedArm,
    robot: RobotDescription,
    clearances: Clearances,
    load_kg: float,
    range_fraction: float,
    seed: int,
) -> tuple[FloatArray, FloatArray]:
    """Return a middle pose, (n,), and poses that can be reached from it, (candidates, n)."""
    limits = [joint.limits for joint in robot.joints]
    low = np.array([each.position_min for each in limits])
    high = np.array([each.position_max for each in limits])
    torque = np.array([each.torque for each in limits])
    random = np.random.default_rng(seed)
    middle, half = (low + high) / 2.0, range_fraction * (high - low) / 2.0
    others = middle + half * random.uniform(-1.0, 1.0, (100, len(low)))
    middle = clearances.clear_pose(middle, others, robot.name)
    found: list[FloatArray] = []
    for _ in range(MOST_DRAWS):
        pose = (low + high) / 2.0 + half * random.uniform(-1.0, 1.0, len(low))
        held = (
            np.zeros(len(low))
            if arm.gravity is None
            else np.abs(arm.gravity.torque(pose[np.newaxis], np.array([load_kg]))[0])
        )
        if (held <= torque).all() and is_clear_between(clearances, middle, pose):
            found.append(pose)
        if len(found) == CANDIDATES:
            return middle, np.array(found)
    raise ConfigError(
        f"robot {robot.name!r}: only {len(found)} of {MOST_DRAWS} random poses are within the"
        f" torque limits and clear of obstacles, but {CANDIDATES} are needed: check `bodies` in the"
        " robot file and `workspace` in the cell file, or give a smaller range fraction or load",
        code="RID-DESIGN-NONE",
    )


def _choose(slopes: FloatArray, is_loaded: BoolArray, quota: tuple[int, int]) -> list[int]:
    """Return the candidates with the largest determinant of the information matrix.

    A greedy choice is followed by exchanges of single candidates (Fedorov).

    Args:
        slopes: Shape (candidates, 3, parameters). Scaled derivatives of the point.
        is_loaded: Shape (candidates,).
        quota: Number of poses without and with load.
    """
    p = slopes.shape[2]
    information = _RIDGE * np.eye(p)
    free = np.ones(len(slopes), dtype=np.bool_)
    chosen: list[int] = []

    def best(loaded: bool) -> tuple[int, float]:
        gain = _gains(slopes, information)
        gain[~free | (is_loaded != loaded)] = -np.inf
        return int(np.argmax(gain)), float(gain.max())

    left = list(quota)
    while sum(left):
        loaded = left[1] >= left[0]
        row, _ = best(loaded)
        chosen.append(row)
        free[row] = False
        left[loaded] -= 1
        information += slopes[row].T @ slopes[row]
    for _ in range(_PASSES):
        is_better = False
        for k, row in enumerate(chosen):
            information -= slopes[row].T @ slopes[row]
            free[row] = True
            other, gain = best(bool(is_loaded[row]))
            own = _gains(slopes[row : row + 1], information)[0]
            if gain > own + 1e-9:
                chosen[k], is_better = other, True
            free[chosen[k]] = False
            information += slopes[chosen[k]].T @ slopes[chosen[k]]
        if not is_better:
            break
    return chosen


def _gains(slopes: FloatArray, information: FloatArray) -> FloatArray:
    """Return the increase of the log determinant by each candidate, (candidates,)."""
    inverse = np.linalg.inv(information)
    inner = np.einsum("kip,pq,kjq->kij", slopes, inverse, slopes, optimize=True)
    return np.asarray(np.linalg.slogdet(np.eye(3) + inner)[1])


def _short_way(position: FloatArray, rows: Sequence[int], start: FloatArray) -> list[int]:
    """Return the rows in an order with short moves: the nearest remaining row comes next."""
    left, here, order = list(rows), start, []
    while left:
        nearest = min(left, key=lambda row: float(np.abs(position[row] - here).max()))
        left.remove(nearest)
        order.append(nearest)
        here = position[nearest]
    return order
