"""Choice of friction terms: 45,000 samples of a six-axis arm at 5 kHz, every candidate.

`python -m benchmarks.choose [--quick]`. Timed is everything between arrays of q, v, a, tau and a
`Comparison`, memory and the torque's channel included as `identify --choose` tries them,
against a single plain fit of the same arrays in the same run, with its intervals. The exhaustive
way fits every candidate, with and without each part, from the rows; it chooses too, from thinned
rows, and must choose the same: the terms that made the data. `--quick` leaves it out. A fit with
presliding on every axis, all distances found from one start, is timed against the plain fit of the
same rows, whose joints remember.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the program sets it

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.memory import with_memory
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.standstill import moving as moves
from identification.choices import STANDSTILL_RAD_S
from identification.equations.segments import cut, thinned
from identification.estimation.estimate import Estimate, predict
from identification.estimation.estimators import estimate_smoothed
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.channel_choice import choose_bandwidth, choose_delays
from identification.validation.friction_selection import (
    CLASSICAL,
    FOLDS,
    FRICTION_CANDIDATES,
    Comparison,
    choose_friction,
    select,
)
from identification.validation.friction_trials import (
    DISTINCT_SIGMAS,
    Terms,
    Trial,
    doubtful_terms,
    with_friction,
)
from identification.validation.presliding_choice import choose_presliding, with_presliding
from identification.validation.stribeck_choice import choose_stribeck

SAMPLES = 45_000
STEP_S = 0.0002
CUTOFF_HZ = 30.0
PERIOD_S = 3.0
BAR = 15.0
PRESLIDING_BAR = 3.0
DISTANCES = (1e-3, 2e-3, 5e-4, 1e-3, 2e-3, 3e-3)
"""What the joints that remember give way [rad]; fits begin at twice that."""
TRUTH: tuple[Terms, ...] = (
    (*CLASSICAL, "offset", "cube_root"),
    (*CLASSICAL, "offset", "cubic", "load"),
    (*CLASSICAL, "offset", "load"),
    CLASSICAL,
    (*CLASSICAL, "offset", "stribeck"),
    (*CLASSICAL, "offset", "cubic"),
)


@dataclass(frozen=True, eq=False)
class ExhaustiveTrials:
    """Trials that fit every model from the rows, as the first version did.

    Attributes
    ----------
    robot : RobotDescription
        The robot; its own friction terms do not count.
    parts : tuple of SmoothedSignals
        Contiguous parts, left out one after the other.
    """

    robot: RobotDescription
    parts: tuple[SmoothedSignals, ...]

    def of(self, friction: Sequence[Terms], name: Terms = ()) -> Trial:
        """Return the trial of a robot with these terms, without criteria."""
        robot = with_friction(self.robot, friction)
        whole = fit_smoothed(robot, self.parts)
        started = EstimationOptions(model=whole.options)
        errors: list[FloatArray] = []
        for part in self.parts:
            others = [other for other in self.parts if other is not part]
            errors.extend(squares(fit_smoothed(robot, others, started), part))
        return Trial(
            terms=name,
            error_nm=np.sqrt(np.nanmean(errors, axis=0)),
            event_errors=np.array(errors),
            parameters=len(whole.base) + len(whole.model.nonlinear_names),
            aic=np.nan,
            bic=np.nan,
        )

    def doubtful(self, friction: Sequence[Terms]) -> tuple[Terms, ...]:
        """Return each joint's terms that the data do not tell from nothing."""
        estimate, small = self._small(friction)
        values = dict(zip(estimate.base.names, estimate.values, strict=True))
        small |= {name for name in values if name.startswith("fs_") and values[name] < 0.0}
        return doubtful_terms(self.robot, friction, small | set(estimate.model.nonlinear_at_bound))

    def offsets_told(self, friction: Sequence[Terms]) -> tuple[bool, ...]:
        """Return which joints' offset is told from zero."""
        estimate, small = self._small(friction)
        offsets = [f"fo_{name}" for name in self.robot.joint_names]
        return tuple(name in estimate.base.names and name not in small for name in offsets)

    def _small(self, friction: Sequence[Terms]) -> tuple[Estimate, set[str]]:
        estimate = estimate_smoothed(with_friction(self.robot, friction), self.parts)
        names = (*estimate.base.names, *estimate.model.nonlinear_names)
        values = np.append(estimate.values, estimate.model.nonlinear_values)
        sigmas = np.append(estimate.sigma, estimate.nonlinear_sigma)
        small = np.flatnonzero(np.abs(values) < DISTINCT_SIGMAS * sigmas)
        return estimate, {names[i] for i in small}


def squares(fit: FittedSignals, part: SmoothedSignals) -> list[FloatArray]:
    """Return the mean squared error of each second, (n,); NaN where a joint stands still."""
    predicted = predict(fit, part.position, part.velocity, part.acceleration)
    moving = moves(fit.model, part.velocity, STANDSTILL_RAD_S)
    error = np.where(moving, (part.torque_nm - predicted) ** 2, 0.0)
    second = np.floor(part.time_s - part.time_s[0])
    found = []
    for number in np.unique(second):
        rows = second == number
        counted = moving[rows].sum(axis=0)
        mean = error[rows].sum(axis=0) / np.maximum(counted, 1)
        found.append(np.where(counted > 0, mean, np.nan))
    return found


def recording(samples: int) -> SmoothedSignals:
    """Return a Fourier motion of an arm with these terms of friction, and torques with noise."""
    robot = with_friction(load_robot("ur10e"), TRUTH)
    random = np.random.default_rng(3)
    time_s: FloatArray = np.arange(samples, dtype=np.float64) * STEP_S
    omega = 2.0 * np.pi / PERIOD_S * np.arange(1, 9)
    sine, cosine = 0.15 * random.normal(size=(2, 8, 6))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q = s @ sine + c @ cosine
    v = (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    model = RobotModel.from_description(robot)
    start = model.nonlinear_values
    start[:] = [0.1 if name.startswith("vs") else 0.08 for name in model.nonlinear_names]
    model = model.with_nonlinear(start)
    values = random.uniform(0.5, 2.0, len(model.parameter_names))
    values[model.parameter_groups["friction"]] *= 10.0
    values[model.parameter_groups["rotors"]] *= 1e-4  # some kg m^2 at the link side
    noise = low_pass(5.0 * random.normal(size=q.shape), STEP_S, CUTOFF_HZ)
    return SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=torque(model, q, v, a, values) + noise,
        segment=np.zeros(samples, dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=CUTOFF_HZ,
    )


def remembering(samples: int) -> tuple[RobotDescription, SmoothedSignals]:
    """Return an arm whose classical friction remembers, and its recording, low-passed."""
    plain, signals = with_friction(load_robot("ur10e"), [CLASSICAL] * 6), recording(samples)
    random = np.random.default_rng(4)
    model = RobotModel.from_description(with_presliding(plain, DISTANCES))
    values = random.uniform(0.5, 2.0, len(model.parameter_names))
    values[model.parameter_groups["friction"]] *= 10.0
    values[model.parameter_groups["rotors"]] *= 1e-4
    q, v, a = signals.position, signals.velocity, signals.acceleration
    tau = torque(model, q, v, a, values, with_memory(model, q))
    tau += 5.0 * random.normal(size=tau.shape)
    return plain, replace(signals, torque_nm=low_pass(tau, STEP_S, CUTOFF_HZ))


def choose_others(
    robot: RobotDescription, found: Comparison, signals: SmoothedSignals
) -> RobotDescription:
    """Choose what `identify --choose` does besides the candidates; return the robot."""
    options = EstimationOptions()
    choose_bandwidth(robot, [signals], options)
    found = replace(found, presliding=choose_presliding(found.robot(robot), [signals], options))
    found = replace(found, stribeck=choose_stribeck(found.robot(robot), [signals], options))
    choose_delays(found.robot(robot), [signals], options)
    return found.robot(robot)


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Return the least processor time of some rounds [s]; the first compiles and is not counted."""
    work()
    times = []
    for _ in range(rounds):
        began_s = time.process_time()
        work()
        times.append(time.process_time() - began_s)
    return min(times)


def main() -> int:
    """Measure and print; the last line is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.choose")
    parser.add_argument("--quick", action="store_true", help="without the exhaustive way")
    options = parser.parse_args()
    robot, signals = load_robot("ur10e"), recording(SAMPLES)
    plain_s = seconds(lambda: estimate_smoothed(robot, [signals]), 3)
    print(f"one plain fit of {SAMPLES} samples: {plain_s:.2f} s")
    choose_s = seconds(lambda: choose_friction(robot, [signals]), 2)
    found = choose_friction(robot, [signals])
    others_s = seconds(lambda: choose_others(robot, found, signals), 2)
    ratio = (choose_s + others_s) / plain_s
    print(f"{len(FRICTION_CANDIDATES)} candidates, joint by joint: {choose_s:.2f} s")
    print(f"presliding, Stribeck, the torque's bandwidth and delays: {others_s:.2f} s")
    print(f"together {ratio:.1f} plain fits")
    chosen = tuple(joint.friction for joint in choose_others(robot, found, signals).joints)
    robot, remembered = remembering(SAMPLES)
    started = with_presliding(robot, [2.0 * distance for distance in DISTANCES])
    fit_s = seconds(lambda: estimate_smoothed(started, [remembered]), 3)
    without_s = seconds(lambda: estimate_smoothed(robot, [remembered]), 3)
    presliding_ratio = fit_s / without_s
    print(f"a fit with presliding: {fit_s:.2f} s, {presliding_ratio:.1f} fits of the same without")
    for name, terms in zip(signals.joint_names, chosen, strict=True):
        print(f"{name}: {', '.join(terms)}")
    ratios = {"plain fits": round(ratio, 1), "presliding": round(presliding_ratio, 1)}
    holds = ratio <= BAR and presliding_ratio <= PRESLIDING_BAR and chosen == TRUTH
    if not options.quick:
        trials = ExhaustiveTrials(load_robot("ur10e"), tuple(cut(thinned(signals), FOLDS)))
        began_s = time.process_time()
        same = select(signals.joint_names, FRICTION_CANDIDATES, trials).chosen == found.chosen
        spent_s = time.process_time() - began_s
        ratios["exhaustive way on thinned rows"] = round(spent_s / choose_s, 1)
        words = "the same" if same else "other"
        print(f"the exhaustive way on thinned rows: {spent_s:.1f} s, {words} terms")
        holds &= same
    print(
        json.dumps(
            {
                "name": "choose",
                "value": round(choose_s + others_s, 2),
                "unit": "s",
                "ratios": ratios,
                "bar": f"at most {BAR:g} plain fits, {PRESLIDING_BAR:g} for one with presliding;"
                " the terms that made the data, in both ways",
                "holds": bool(holds),
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
