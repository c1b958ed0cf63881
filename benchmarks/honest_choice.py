"""Choice of torque channel and friction terms for simulated arms, compared with the truth.

`python -m benchmarks.honest_choice` evaluates 84 cases of arms with three, six and seven axes;
`--quick` evaluates a few of the three-axis arm. `--tuning` uses the random seeds with which the
thresholds were chosen. By default, other seeds are used. The seeds 201 to 205 are not used, because
failures with them led to changes of the program. Pinocchio simulates the arms
(`benchmarks.known_arms`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.ndimage import maximum_filter1d
from scipy.signal import bilinear, filtfilt, lfilter

from acquisition.clock.judgement import judge_clock
from acquisition.clock.report import ClockState
from acquisition.clock.samples import Samples
from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.processing.torque_channel import ChannelKind
from acquisition.recording.recording import Recording
from benchmarks.known_arms import ARMS, STEP_S, Driven, Friction, MotionKind, drive
from config.arrays import FloatArray
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.channel_choice import KINDS
from identification.validation.model_choice import ModelChoice, choose_model
from identification.validation.torque_prediction import validate_torques

Effect = Literal["none", "delay", "lag8", "lag5", "zero5", "repeats"]

DURATION_S: Final = 40.0
BAND_HZ: Final = 10.0
STRIDE: Final = 4
BITS: Final = 19
NOISE: Final = 0.01
TUNING_SEEDS: Final = range(1, 10)
JUDGING_SEEDS: Final = range(206, 211)
OPEN_TERMS: Final[tuple[FrictionTerm, ...]] = (
    "offset", "cubic", "shear_thinning", "stribeck", "load", "presliding", "temperature",
)  # fmt: skip
FRICTIONS: Final[dict[str, Friction]] = {
    "plain": Friction(),
    "stribeck": Friction(stribeck=0.5),
    "load": Friction(load=0.09),
    "both": Friction(stribeck=0.5, load=0.09),
}
KIND_OF: Final[dict[Effect, ChannelKind]] = {
    "none": "none",
    "delay": "delay",
    "lag8": "lag",
    "lag5": "lag",
    "zero5": "zero-phase",
    "repeats": "none",
}
AWAY_S: Final = 0.1
"""Time before and after standstill whose rows are not evaluated [s]: one period of `BAND_HZ`."""
SAME_KIND_LIMIT: Final = 1.02
OTHER_KIND_LIMIT: Final = 1.10


@dataclass(frozen=True)
class Case:
    """A simulated recording session.

    Attributes:
        arm, friction: Keys of `ARMS` and `FRICTIONS`.
        effect: Disturbance of the recorded torque or of its time stamps, as in `Effect`.
        seed: Seed of motions, noise and delays.
    """

    arm: str
    friction: str
    effect: Effect
    seed: int

    @property
    def true_terms(self) -> set[FrictionTerm]:
        """Friction terms in addition to Coulomb and viscous friction."""
        own = FRICTIONS[self.friction]
        found: set[FrictionTerm] = {"stribeck"} if own.stribeck else set()
        return found | ({"load"} if own.load else set())

    def delays_s(self) -> FloatArray:
        """Return the true delay of each joint: none, or 1 to 8 ms [s]."""
        n = ARMS[self.arm].joints
        random = np.random.default_rng([self.seed, 3])
        delays = np.where(random.random(n) < 0.5, 0.0, random.uniform(0.001, 0.008, n))
        delays[int(random.integers(n))] = random.uniform(0.003, 0.008)  # one at least
        return delays if self.effect == "delay" else np.zeros(n)


@dataclass
class Tally:
    """Counts over cases."""

    cases: int = 0
    kinds: int = 0
    true_terms: int = 0
    found_terms: int = 0
    open_terms: int = 0
    false_terms: int = 0
    delays: int = 0
    delays_inside: int = 0
    sound_joints: int = 0
    false_delays: int = 0
    joints: int = 0
    worse_same: int = 0
    worse_other: int = 0

    def add(self, case: Case, chosen: ModelChoice, ratios: tuple[FloatArray, FloatArray]) -> str:
        """Count a case; return a sentence about its errors."""
        robot = chosen.robot(ARMS[case.arm].description())
        wrong = []
        for joint in robot.joints:
            added = set(joint.friction) - {"coulomb", "viscous"}
            self.true_terms += len(case.true_terms)
            self.found_terms += len(added & case.true_terms)
            self.open_terms += len(OPEN_TERMS) - len(case.true_terms)
            self.false_terms += len(added - case.true_terms)
            if added != case.true_terms:
                wrong.append(f"{joint.name} has {', '.join(sorted(added)) or 'no terms'}")
        self.cases += 1
        kind, truth = chosen.channel.kind, case.delays_s()
        self.kinds += kind == KIND_OF[case.effect]
        if kind != KIND_OF[case.effect]:
            wrong.append(f"channel {kind}")
        if KIND_OF[case.effect] in ("none", "delay"):
            stated = chosen.channel.delay_s != 0.0
            inside = np.abs(chosen.channel.delay_s - truth) <= 3.0 * chosen.channel.delay_sigma_s
            self.delays += int(stated.sum())
            self.delays_inside += int((stated & inside).sum())
            self.sound_joints += int((truth == 0.0).sum())
            self.false_delays += int((stated & (truth == 0.0)).sum())
        self.joints += len(robot.joints)
        self.worse_same += int(np.sum(ratios[0] > SAME_KIND_LIMIT))
        self.worse_other += int(np.sum(ratios[1] > OTHER_KIND_LIMIT))
        worst = (
            "largest error over that of the plain model:"
            f" {ratios[0].max():.3f} on the same kind of motion, {ratios[1].max():.3f} on another"
        )
        return "; ".join([*wrong, worst])

    def shares(self) -> dict[str, float]:
        """Return the fractions that must reach their required values."""
        return {
            "true terms": self.found_terms / max(self.true_terms, 1),
            "false terms": self.false_terms / max(self.open_terms, 1),
            "kinds": self.kinds / max(self.cases, 1),
            "delays inside": self.delays_inside / max(self.delays, 1),
            "false delays": self.false_delays / max(self.sound_joints, 1),
            "worse joints": (self.worse_same + self.worse_other) / max(self.joints, 1),
        }

    def holds(self) -> bool:
        """Return True if every requirement is met."""
        own = self.shares()
        return (
            own["true terms"] >= 0.98
            and own["false terms"] <= 0.01
            and own["kinds"] >= 0.95
            and (own["delays inside"] >= 0.95 or self.delays == 0)
            and own["false delays"] == 0.0
            and own["worse joints"] == 0.0
        )


def recorded_torque(case: Case, torque_nm: FloatArray) -> FloatArray:
    """Return the torques with the effect of the case's channel, at the same times."""
    if case.effect in ("lag8", "lag5", "zero5"):
        omega = 2.0 * np.pi * float(case.effect[-1])
        b, a = bilinear([omega], [1.0, omega], 1.0 / STEP_S)
        if case.effect == "zero5":
            return np.asarray(filtfilt(b, a, torque_nm, axis=0))
        return np.asarray(lfilter(b, a, torque_nm - torque_nm[0], axis=0) + torque_nm[0])
    if case.effect != "delay":
        return torque_nm
    time_s = STEP_S * np.arange(len(torque_nm))
    columns = [
        CubicSpline(time_s, own)(np.maximum(time_s - late, 0.0))
        for own, late in zip(torque_nm.T, case.delays_s(), strict=True)
    ]
    return np.stack(columns, axis=1)


def recording(
    case: Case, driven: Driven, number: int, robot: RobotDescription
) -> tuple[Recording, bool]:
    """Return a logger's recording, and True if its clock is known.

    It has 250 Hz, encoder steps, noise and the case's effect. If rows are repeated, the clock is
    checked as on import.
    """
    known = True
    random = np.random.default_rng([case.seed, 4, number])
    torque = recorded_torque(case, driven.torque_nm)
    rms = np.sqrt(np.mean(torque**2, axis=0))
    torque = torque + NOISE * rms * random.normal(size=torque.shape)
    step = 2.0 * np.pi / 2**BITS
    position = np.round(driven.position / step) * step
    rows = np.arange(0, len(position), STRIDE)
    if case.effect == "repeats":
        rows = np.repeat(rows, np.where(np.arange(len(rows)) % 11 == 10, 2, 1))
    time_s: FloatArray = STRIDE * STEP_S * np.arange(len(rows), dtype=np.float64)
    if case.effect == "repeats":
        speed = make_interp_spline(driven.time_s, driven.position, k=5)(driven.time_s, 1)
        samples = Samples(time_s, position[rows], np.round(speed[rows] / 1e-4) * 1e-4, torque[rows])
        judged = judge_clock(samples, robot)
        rows, time_s = rows[judged.kept], judged.time_s
        known = judged.report.clock is not ClockState.UNKNOWN
    count = len(rows)
    found = Recording(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=position[rows],
        torque_nm=torque[rows],
        valid=np.ones(count, dtype=np.bool_),
        phase=np.full(count, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(count, dtype=np.int64),
        source="import",
    )
    return found, known


def judge(case: Case, tally: Tally) -> str:
    """Choose a model on two recordings; predict two others with it and with the plain model."""
    robot, friction = ARMS[case.arm].description(), FRICTIONS[case.friction]
    first: MotionKind = "points" if case.seed % 2 else "sines"
    kinds: tuple[MotionKind, ...] = (first, "points", "points", "sines")
    recorded = [
        recording(case, drive(case.arm, kind, 10 * case.seed + k, friction, DURATION_S), k, robot)
        for k, kind in enumerate(kinds)
    ]
    runs = [run for run, _ in recorded]
    signals = [smooth_nonperiodic(run, BAND_HZ) for run in runs[:2]]
    clocks_known = all(known for _, known in recorded[:2])
    chosen = choose_model(robot, signals, kinds=tuple(KINDS) if clocks_known else ("none",))
    channel = chosen.channel if chosen.channel.changes else None
    plain = fit_smoothed(robot, signals).estimate()
    known = [replace(run, channel=channel) for run in signals]
    model = replace(fit_smoothed(chosen.robot(robot), known).estimate(), channel=channel)
    same, other = (_ratio(model, plain, run) for run in runs[2:])
    if first == "sines":  # both kinds of motion were in the training runs
        same, other = np.maximum(same, other), np.ones_like(other)
    return tally.add(case, chosen, (same, other))


def _ratio(model: Estimate, plain: Estimate, run: Recording) -> FloatArray:
    """Return each joint's prediction error with a model, divided by that with the plain model.

    Both errors use the same rows, away from standstill: the friction of a sticking joint depends on
    the applied torque, and no model predicts it.
    """
    found = [validate_torques(each, run, cutoff_hz=BAND_HZ) for each in (model, plain)]
    counted = found[0].counted & found[1].counted
    still = np.abs(found[0].velocity) < found[0].standstill_rad_s
    reach = 2 * round(AWAY_S / (found[0].time_s[1] - found[0].time_s[0])) + 1
    counted &= ~maximum_filter1d(still, reach, axis=0)
    errors = [
        np.sqrt(np.mean((each.measured_nm - each.predicted_nm) ** 2, axis=0, where=counted))
        for each in found
    ]
    return np.asarray(errors[0] / errors[1])


def cases(seeds: Sequence[int], quick: bool) -> Iterator[Case]:
    """Yield the cases: all friction models and effects on three axes, some on six and seven."""
    effects: tuple[Effect, ...] = ("none", "delay", "lag8", "lag5", "zero5", "repeats")
    if quick:
        yield Case("three", "both", "none", seeds[0])
        yield Case("three", "plain", "delay", seeds[0])
        yield Case("three", "stribeck", "zero5", seeds[0])
        return
    for friction in FRICTIONS:
        for effect in effects:
            for seed in seeds[:3]:
                yield Case("three", friction, effect, seed)
    for effect in effects[:2]:
        for friction in FRICTIONS:
            yield Case("six", friction, effect, seeds[3])
    for effect, friction in zip(effects[2:], FRICTIONS, strict=True):
        yield Case("seven", friction, effect, seeds[4])


def main() -> int:
    """Evaluate the cases, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.honest_choice")
    parser.add_argument("--quick", action="store_true", help="three cases of the three-axis arm")
    parser.add_argument("--tuning", action="store_true", help="use the seeds of the tuned limits")
    parser.add_argument("--only", default="", help="only cases whose name contains this text")
    options = parser.parse_args()
    tally = Tally()
    for case in cases(TUNING_SEEDS if options.tuning else JUDGING_SEEDS, options.quick):
        name = f"{case.arm} {case.friction} {case.effect} {case.seed}"
        if options.only in name:
            print(f"{name}: {judge(case, tally)}", flush=True)
    print(tally)
    print(
        json.dumps(
            {
                "name": "honest_choice",
                "value": round(tally.shares()["false terms"], 4),
                "unit": "fraction of false terms",
                "ratios": {name: round(own, 4) for name, own in tally.shares().items()},
                "bar": "at least 98 % of the true friction terms chosen, at most 1 % of the others;"
                " the right kind of torque channel in 95 % of the cases; no false delay; 95 % of"
                " the delays within three sigma; no joint's error 2 % above that of the plain model"
                " (10 % on another kind of motion)",
                "holds": tally.holds(),
            }
        )
    )
    return 0 if tally.holds() else 1


if __name__ == "__main__":
    sys.exit(main())
