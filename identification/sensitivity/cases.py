"""Rows of the thesis's table 5.3: a wrong assumption and its size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from config.robot.robot import RobotDescription
from identification.sensitivity.problem import (
    Assumptions,
    Comparison,
    SampledMotion,
    SensitivityProblem,
    deviation_percent,
    estimate_under_assumption,
    prediction_error,
    root_mean_square,
)

SHARE: Final = 0.1
PERIOD_S: Final = 30.0
HIGH: Final = 20
SAMPLES: Final = 834
PHASES: Final = 21
OTHER_PHASES: Final = 22
DIFFERENCE: Final = "difference"
Motion = Literal["wrist", "all"]


@dataclass(frozen=True)
class SensitivityCase:
    """One row of the table.

    Attributes:
        number, words: Number and description of the row.
        assumed: The wrong assumption.
        motion: The axes that move: axis 3 to the last axis, or all axes.
        against: Comparison for which the row is meaningful. A wrong torque constant also scales the
            torques of the unloaded robot: a model identified with the same constant is then no
            better than a second run. Errors of links and rotors cancel between two runs.
    """

    number: int
    words: str
    assumed: Assumptions
    motion: Motion = "wrist"
    against: Comparison = "model"


@dataclass(frozen=True)
class SensitivityRow:
    """A case, the errors of the payload's parameters, and the torque errors on another motion.

    Attributes:
        percent: Deviations of the parameters in the order of `REPORTED`, relative to the true
            values [%]; None if the true value is zero.
        torque_percent: RMS torque error of each axis relative to the axis's RMS torque, on a motion
            that was not used for the estimate [%]; None for an axis at rest.
    """

    case: SensitivityCase
    against: Comparison
    percent: tuple[float | None, ...]
    torque_percent: tuple[float | None, ...]

    @property
    def worst_torque_percent(self) -> float:
        """Largest torque error of an axis [%]."""
        return max(each for each in self.torque_percent if each is not None)


def thesis_motion(
    robot: RobotDescription, axes: Sequence[int], phases_seed: int = PHASES
) -> SampledMotion:
    """Return a motion like those of the thesis's chapter 5, around mid-range.

    Each axis moves with harmonics 1 and 20 of a period of 30 s.

    Args:
        robot: The robot, for its limits.
        axes: The moving axes, from 0.
        phases_seed: Random seed of the phases; `OTHER_PHASES` for the motion on which torques are
            predicted.
    """
    random = np.random.default_rng(phases_seed)
    time_s = np.arange(SAMPLES) * (PERIOD_S / SAMPLES)
    q, v, a = np.zeros((3, SAMPLES, len(robot.joints)))
    phases = random.uniform(0.0, 2.0 * np.pi, (len(robot.joints), 2))
    for j, joint in enumerate(robot.joints):
        limits = joint.limits
        q[:, j] = (limits.position_max + limits.position_min) / 2.0
        if j not in axes:
            continue
        reach = min((limits.position_max - limits.position_min) / 2.0, np.pi)
        low, high = 2.0 * np.pi / PERIOD_S, 2.0 * np.pi * HIGH / PERIOD_S
        for omega, amplitude, phase in (
            (low, 0.4 * min(reach, limits.velocity / low), phases[j, 0]),
            (high, 0.15 * min(reach, limits.acceleration / high**2), phases[j, 1]),
        ):
            angle = omega * time_s + phase
            q[:, j] += amplitude * np.sin(angle)
            v[:, j] += amplitude * omega * np.cos(angle)
            a[:, j] -= amplitude * omega**2 * np.sin(angle)
    return SampledMotion(q, v, a)


def thesis_cases(axes: int, share: float = SHARE, bias_nm: float = -12.0) -> list[SensitivityCase]:
    """Return the rows of table 5.3 for an arm of `axes` axes.

    Torque constants and links are wrong by the relative error `share`. For arms without
    six axes, axis 3 is the first that lifts, and groups end with the last axis.

    Args:
        axes: Number of axes, at least 3.
        share: Relative error of the assumptions.
        bias_nm: Bias of the torque of axis 3 [N m].
    """

    def gains(*numbers: int) -> tuple[float, ...]:
        return tuple(1.0 + share if j + 1 in numbers else 1.0 for j in range(axes))

    wrist = list(range(3, axes + 1))
    cases = [
        SensitivityCase(1, "torque constant 3", Assumptions(gains=gains(3)), against=DIFFERENCE)
    ]
    if axes >= 6:
        cases += [
            SensitivityCase(
                1, "torque constant 4", Assumptions(gains=gains(4)), against=DIFFERENCE
            ),
            SensitivityCase(
                1, "torque constants 5+6", Assumptions(gains=gains(5, 6)), against=DIFFERENCE
            ),
            SensitivityCase(
                1, "torque constants 4-6", Assumptions(gains=gains(4, 5, 6)), against=DIFFERENCE
            ),
        ]
    all_wrong = Assumptions(gains=gains(*wrist))
    links = Assumptions(links=1.0 + share)
    bias = tuple(bias_nm if j == 2 else 0.0 for j in range(axes))
    return [
        *cases,
        SensitivityCase(1, f"torque constants 3-{axes}", all_wrong, against=DIFFERENCE),
        SensitivityCase(2, "robot links", links),
        SensitivityCase(3, "rotor inertia neglected", Assumptions(rotors=0.0)),
        SensitivityCase(3, "rotor inertia 25 % too small", Assumptions(rotors=0.75)),
        SensitivityCase(4, "wrist coupling neglected", Assumptions(coupling=0.0)),
        SensitivityCase(5, "efficiency 90 %", Assumptions(efficiency=0.9)),
        SensitivityCase(5, "efficiency 95 %", Assumptions(efficiency=0.95)),
        SensitivityCase(6, "25 % of friction acts in the joints", Assumptions(joint_friction=0.25)),
        SensitivityCase(7, "known mass, wrong robot links", replace(links, known_mass=1.0)),
        SensitivityCase(
            7, f"known mass, wrong torque constants 3-{axes}", replace(all_wrong, known_mass=1.0)
        ),
        SensitivityCase(7, "known mass 5 % too large", Assumptions(known_mass=1.05)),
        SensitivityCase(8, f"torque bias {bias_nm:g} Nm, axis 3", Assumptions(bias=bias)),
        SensitivityCase(
            9, "all axes move, torque constant 3", Assumptions(gains=gains(3)), "all", DIFFERENCE
        ),
        SensitivityCase(
            9, f"all axes move, torque constants 3-{axes}", all_wrong, "all", DIFFERENCE
        ),
    ]


def sensitivity_row(
    case: SensitivityCase,
    problems: dict[Motion, SensitivityProblem],
    against: Comparison | None = None,
) -> SensitivityRow:
    """Simulate a wrong assumption; return its row of the sensitivity table (thesis, table 5.3).

    Args:
        case: The wrong assumption.
        problems: The robot with its payload for each of the two motions: of the axes from 3 on, and
            of all axes.
        against: What is subtracted to obtain the payload's torque: a model of the robot, or a run
            without payload. By default, the comparison of the case.

    Raises:
        EstimationError: The motion does not determine all ten parameters of the payload.
    """
    problem, against = problems[case.motion], against or case.against
    percent = deviation_percent(problem, estimate_under_assumption(problem, case.assumed, against))
    axes = problem.motion.moving.tolist()
    other = thesis_motion(problem.robot, axes, OTHER_PHASES)
    error, size = map(root_mean_square, prediction_error(problem, case.assumed, against, other))
    return SensitivityRow(
        case,
        against,
        tuple(float(p) if np.isfinite(p) else None for p in percent),
        tuple(100.0 * float(error[j] / size[j]) if j in axes else None for j in range(len(size))),
    )
