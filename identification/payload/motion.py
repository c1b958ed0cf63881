"""Design of a payload session's motion, by a small search for low uncertainty of payloads.

The objective is the uncertainty of mass and centre of gravity. The parameters of the robot do not
matter, because they cancel between a run with the payload and one without. Fast joints heat the
motors, and so does an arm that is held out against gravity. Therefore speeds stay moderate. At
moderate speed, gravity in many poses of the wrist gives most of the information on a payload.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.standstill import moving_actuators as moves
from dynamics.terms.conditions import Conditions
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.design.two_harmonic import TwoHarmonicOptions, two_harmonic_draws
from identification.model.options import ModelOptions
from identification.model.torque_columns import torque_columns
from identification.payload.equations import PayloadModel

POSITION_SHARE: Final = 0.8
SPEED_SHARE: Final = 0.2
HARMONICS: Final = 6
DRAWS: Final = 200
STEPS: Final = 3000

SLOW_RAD_S: Final = 0.05
POINTS_PER_HARMONIC: Final = 16
ARM_M: Final = 0.3
MASS_KG: Final = 5.0
MASS_GOAL_KG: Final = 0.04
CENTRE_GOAL_M: Final = 0.002
NOISE_SHARE: Final = 0.0035
ROWS: Final = 8000
GAIN_SHARE: Final = 0.003
LASTING_SHARE: Final = 0.1
HEAT_WEIGHT: Final = 10.0
FIRST_STEP: Final = 0.3
LAST_STEP: Final = 0.03
CHANGED_SHARE: Final = 0.3
DECIMALS: Final = 6


@dataclass(frozen=True)
class PayloadSearch:
    """Task of the search for a motion.

    Attributes:
        robot: The robot with its limits and bodies.
        period_s, sample_period_s: The period and the cell's cycle time [s].
        harmonics: The highest harmonic of every joint, at least 2.
        position_share, speed_share: Usable fractions of the position ranges, and of the speed and
            acceleration limits.
        workspace: Surroundings of the robot. The shape of the payload is not considered.
    """

    robot: RobotDescription
    period_s: float
    sample_period_s: float
    harmonics: int = HARMONICS
    position_share: float = POSITION_SHARE
    speed_share: float = SPEED_SHARE
    workspace: Workspace = field(default_factory=Workspace)

    def __post_init__(self) -> None:
        shares = (self.position_share, self.speed_share)
        if self.harmonics < 2 or not all(0.0 < share <= 1.0 for share in shares):
            raise ConfigError(
                f"payload motion: harmonics is {self.harmonics} (at least 2 are needed), the"
                f" fractions of the limits are {shares[0]:g} and {shares[1]:g} (more than 0, at"
                " most 1): correct the value outside of its range",
                code="RID-OPTION-RANGE",
            )

    @cached_property
    def model(self) -> PayloadModel:
        """The payload model, with separate friction in every run."""
        plain = ModelOptions(rotors=False, spring=False, friction_terms=("coulomb", "viscous"))
        return PayloadModel.of(self.robot, plain)

    @property
    def conditions(self) -> Conditions:
        """Conditions with a payload; temperatures have no effect here."""
        return Conditions(temperature_k=np.full(len(self.robot.joints), 300.0), payload=True)

    @cached_property
    def clearances(self) -> Clearances:
        """Bodies that must stay apart."""
        return Clearances.of(self.robot, self.workspace)

    @cached_property
    def _links(self) -> FloatArray | None:
        """Base parameters of the links from their drawings, (b,); None without drawings."""
        if self.robot.cad is None:
            return None
        drawn = cad_parameters(self.model.model, self.robot)[0]
        return np.asarray(self.model.base.from_standard(drawn), dtype=np.float64)

    @cached_property
    def _omega(self) -> FloatArray:
        return np.asarray(2.0 * math.pi / self.period_s * np.arange(1.0, self.harmonics + 1.0))

    @cached_property
    def _ranges(self) -> FloatArray:
        """Middle, half range, speed and acceleration limit of each joint, (4, n)."""
        limits = [joint.limits for joint in self.robot.joints]
        return np.array(
            [
                ((x.position_max + x.position_min) / 2.0, (x.position_max - x.position_min) / 2.0,
                 x.velocity, x.acceleration)
                for x in limits
            ]
        ).T  # fmt: skip

    def within_limits(self, coefficients: FloatArray) -> FloatArray:
        """Return Fourier coefficients of the joints, scaled down to satisfy the limits.

        The sum of a joint's amplitudes stays below each limit, so that no phase can violate one.
        Coefficients are (n, 1 + 2 N) for n joints: offset, N sine and N cosine amplitudes.
        """
        n = self.harmonics
        middle, half, fastest, hardest = self._ranges
        amplitude = np.hypot(coefficients[:, 1 : 1 + n], coefficients[:, 1 + n :])
        used = np.max(
            [
                amplitude.sum(axis=1) / (self.position_share * half),
                amplitude @ self._omega / (self.speed_share * fastest),
                amplitude @ self._omega**2 / (self.speed_share * hardest),
            ],
            axis=0,
        )
        shrink = 1.0 / np.maximum(used, 1.0)
        kept = coefficients * shrink[:, np.newaxis]
        room = np.maximum(self.position_share * half - amplitude.sum(axis=1) * shrink, 0.0)
        kept[:, 0] = middle + np.clip(coefficients[:, 0] - middle, -room, room)
        return np.asarray(kept)

    def motion_of(self, coefficients: FloatArray, like: FourierMotion) -> FourierMotion:
        """Return the motion `like` with other Fourier coefficients, (n, 1 + 2 N)."""
        n, rounded = self.harmonics, np.round(coefficients, DECIMALS)
        joints = tuple(
            FourierJoint(
                joint=joint.name,
                offset=float(row[0]),
                sine=tuple(row[1 : 1 + n].tolist()),
                cosine=tuple(row[1 + n :].tolist()),
            )
            for joint, row in zip(self.robot.joints, rounded, strict=True)
        )
        return like.model_copy(update={"joints": joints})

    def coefficients_of(self, motion: FourierMotion) -> FloatArray:
        """Return the Fourier coefficients of each joint of a motion, (n, 1 + 2 N).

        A row has the offset, N sine and N cosine coefficients.
        """
        n = self.harmonics
        rows = np.zeros((len(motion.joints), 1 + 2 * n))
        for row, joint in zip(rows, motion.joints, strict=True):
            row[0] = joint.offset
            row[1 : 1 + len(joint.sine)] = joint.sine
            row[1 + n : 1 + n + len(joint.cosine)] = joint.cosine
        return rows

    def path(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration at a few points, (points, n) each."""
        points = POINTS_PER_HARMONIC * self.harmonics
        angle = np.outer(np.arange(points) * (self.period_s / points), self._omega)
        sine, cosine = (
            coefficients[:, 1 : 1 + self.harmonics],
            coefficients[:, 1 + self.harmonics :],
        )
        s, c, w = np.sin(angle), np.cos(angle), self._omega
        return (
            coefficients[:, 0] + s @ sine.T + c @ cosine.T,
            (c * w) @ sine.T - (s * w) @ cosine.T,
            -(s * w**2) @ sine.T - (c * w**2) @ cosine.T,
        )

    def objective(self, coefficients: FloatArray) -> float:
        """Return the expected uncertainty of payloads; infinite if a payload is not determined.

        The objective is averaged over six nominal payloads, each 0.3 m away along one of the
        flange's axes. It contains:
        - the variances of mass and centre of gravity, with 2 mm equivalent to 40 g, caused by noise
          (a fraction of each joint's torque limit) and by torque constants (0.3 % of each,
          independent);
        - a penalty for motions whose RMS torque, from the links' drawings, exceeds a tenth of a
          limit. Motors can sustain about a third of the limit, but warm motors drift.
        """
        model, motion = self.model, self.path(coefficients)
        limits = np.array([joint.limits.torque for joint in self.robot.joints])
        columns = torque_columns(model.model, model.base, motion, self.conditions)
        excess = self._excess_torque(columns / limits[:, np.newaxis])
        moving = moves(model.model, motion[1], SLOW_RAD_S)
        columns = columns * (moving / limits)[:, :, np.newaxis]
        rows = columns.reshape(-1, columns.shape[2])
        friction = rows[:, model.friction]
        basis = np.linalg.qr(friction[:, np.linalg.norm(friction, axis=0) > 0.0])[0]
        payload = rows[:, -PARAMETERS_PER_LINK:] @ model.flange_to_link
        rest = payload - basis @ (basis.T @ payload)
        size = np.linalg.norm(rest, axis=0)
        if not size.all():
            return math.inf
        left, singular, right = np.linalg.svd(rest / size, full_matrices=False)
        if singular[-1] <= 1e-5 * singular[0]:
            return math.inf
        inverse = (right.T / singular) @ left.T / size[:, np.newaxis]
        noise = NOISE_SHARE * math.sqrt(len(columns) / ROWS)
        spread = float(np.sum((noise * (_WANTED.reshape(-1, PARAMETERS_PER_LINK) @ inverse)) ** 2))
        # A wrong torque constant of a joint scales this joint's part of the solution.
        joints = (
            inverse.reshape(PARAMETERS_PER_LINK, -1, len(limits)),
            rest.reshape(*columns.shape[:2], -1),
        )
        slopes = np.einsum("akj,kjb->jab", *joints, optimize=True)
        gains = GAIN_SHARE * np.einsum("pga,jab,pb->pgj", _WANTED, slopes, _BODIES, optimize=True)
        return math.log(spread + float(np.sum(gains**2))) + HEAT_WEIGHT * excess

    def _excess_torque(self, shares: FloatArray) -> float:
        """Return the squared excess of RMS torques over `LASTING_SHARE` of the torque limits."""
        if self._links is None:
            return 0.0
        lasting = np.sqrt(np.mean((shares @ self._links) ** 2, axis=0))
        return float(np.sum(np.maximum(lasting / LASTING_SHARE - 1.0, 0.0) ** 2))

    def improve(
        self, coefficients: FloatArray, seed: int, steps: int, watch: Callable[[int], None]
    ) -> FloatArray:
        """Return coefficients after random changes that improve the objective and stay clear.

        Args:
            coefficients: Coefficients of the first motion.
            seed: Seed of the changes.
            steps: Number of changes tried.
            watch: Function to call with the number of changes tried so far.
        """
        random = np.random.default_rng(seed)
        falling = np.arange(1, self.harmonics + 1) ** -1.5
        decay = np.concatenate([[1.0], falling, falling])
        best, size = self.objective(coefficients), FIRST_STEP
        for number in range(1, steps + 1):
            j = int(random.integers(len(coefficients)))
            step = size * self._ranges[1, j] * decay * random.standard_normal(len(decay))
            tried = coefficients.copy()
            tried[j] += np.where(random.random(len(decay)) < CHANGED_SHARE, step, 0.0)
            tried = self.within_limits(tried)
            objective = self.objective(tried)
            if objective < best and self.clearances.is_clear(self.path(tried)[0]):
                coefficients, best = tried, objective
                size = min(1.0, 1.3 * size)
            else:
                size = max(LAST_STEP, 0.99 * size)
            watch(number)
        return coefficients


def design_payload_motion(
    search: PayloadSearch,
    *,
    seed: int = 0,
    periods: int = 18,
    draws: int = DRAWS,
    steps: int = STEPS,
    watch: Callable[[int, int], None] = lambda _done, _total: None,
) -> FourierMotion:
    """Search for a motion that determines payloads well, and verify it, including its ramps.

    The best of several two-harmonic draws (3.22) is changed at random; changes that improve it are
    kept. The same seed gives the same motion.

    Args:
        search: Task of the search.
        seed: Seed of draws and changes.
        periods: Number of recorded periods, after one for settling.
        draws, steps: Number of initial draws, and number of changes tried.
        watch: Function to call with the numbers of steps done and of all steps.

    Raises:
        ConfigError: No draw determines the whole payload and stays clear of obstacles.
    """
    drawn = two_harmonic_draws(
        search.robot,
        TwoHarmonicOptions(
            search.period_s,
            highest_harmonic=search.harmonics,
            limit_fraction=min(search.position_share, search.speed_share),
            seed=seed,
            periods=periods,
        ),
    )

    def improving(step: int) -> None:
        watch(draws + step, draws + steps)

    starts = []
    for count, motion in enumerate(itertools.islice(drawn, draws), start=1):
        starts.append((motion, search.coefficients_of(motion)))
        watch(count, draws + steps)
    for motion, coefficients in sorted(starts, key=lambda start: search.objective(start[1])):
        if not math.isfinite(search.objective(coefficients)):
            break
        if not search.clearances.is_clear(search.path(coefficients)[0]):
            continue
        found = search.motion_of(search.improve(coefficients, seed, steps, improving), motion)
        if search.clearances.is_clear(found.plan(search.robot, search.sample_period_s).position):
            return found
    raise ConfigError(
        f"none of {draws} candidate motions determines a payload and stays clear of the robot's"
        " own bodies and of the workspace: specify a motion with --motion (`rid-daq design`"
        " avoids obstacles)",
        code="RID-DESIGN-NONE",
    )


def _nominal() -> tuple[FloatArray, FloatArray]:
    """Return the matrices that scale errors of six nominal payloads, and the payloads.

    The matrices, (6, 4, 10), give errors of mass and centre of gravity divided by their goals.
    Because c = s / m, an error of the centre is (error of s - c times the error of m) / m. The
    payloads are the ten parameters, (6, 10).
    """
    wanted = np.zeros((6, 4, PARAMETERS_PER_LINK))
    bodies = np.zeros((6, PARAMETERS_PER_LINK))
    for rows, body, direction in zip(
        wanted, bodies, np.vstack([np.eye(3), -np.eye(3)]), strict=True
    ):
        body[:4] = MASS_KG, *(MASS_KG * ARM_M * direction)
        rows[0, 0] = 1.0 / MASS_GOAL_KG
        rows[1:, 0] = -ARM_M * direction / (MASS_KG * CENTRE_GOAL_M)
        rows[1:, 1:4] = np.eye(3) / (MASS_KG * CENTRE_GOAL_M)
    return wanted, bodies


_WANTED, _BODIES = _nominal()
