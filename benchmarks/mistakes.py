"""Fraction of the mistakes in files and wiring that rid-daq detects, and false alarms.

`python -m benchmarks.mistakes` injects each mistake into a correct recording, then imports and
identifies it with the commands, as a user would. The robots are invented three- and six-axis arms
with effects that no model has and, if `RID_DAQ_DATA` names the folder of recordings, a real UR10e.

A mistake is detected if a command refuses the data, or if `identify` names the mistake's kind and
its joints. A mistake is visible if the true description explains the data far better than the wrong
one. A mistake that is neither visible nor refused is printed but not counted.

False alarms are counted in two ways. First, the correct recordings go through the same commands and
must pass without a finding. Second, further correct runs are searched for mistakes; half of these
runs last only 4 to 9 s. No mistake must be found in them. `--sound` and `--arms` set the amount of
work. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks.mistakes_made import DEGREE, UserFiles, mistakes
from benchmarks.plate_mistakes import SOUND, plate_outcomes
from benchmarks.sound_robots import sound_run, sound_runs
from config.errors import RidDaqError
from config.load import load_robot, to_yaml
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor
from identification.choices import BAND_HZ
from identification.model.drawn_arm import drawn_parameters
from identification.wiring.search import find_impossibilities, find_mistakes
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations, WiringTrial
from rid_daq.app import run

DETECTED_BAR: Final = 0.95
SHORT_S: Final = (4.0, 9.0)
SOUND_RUNS: Final = 200
PLATES: Final = 12
ARMS: Final = ("ir361", "kr15", "ur10e")


@dataclass(frozen=True)
class Outcome:
    """Result for one injected mistake.

    Attributes:
        arm, name: Robot and mistake.
        refused: True if a command ended with an error and no mistake was named.
        named: True if `identify` named its kind and its joints.
        visible: True if the mistake has an effect on the data.
    """

    arm: str
    name: str
    refused: bool
    named: bool
    visible: bool


def sources(arms: tuple[str, ...], first_seed: int) -> Iterator[UserFiles]:
    """Yield a correct recording of each arm; for seed 0, the UR10e's is real if it is available."""
    for arm in arms:
        robot = load_robot(arm)
        real = os.environ.get("RID_DAQ_DATA")
        if arm == "ur10e" and real is not None and first_seed == 0:
            yield _real(Path(real) / "ur10e")
            continue
        sound = sound_run(robot, np.random.default_rng([first_seed, ARMS.index(arm)]))
        yield UserFiles.of(sound)


def _real(folder: Path) -> UserFiles:
    """Return a recording of a real UR10e."""
    robot = load_robot("ur10e")
    table = np.loadtxt(folder / "ur-20_02_12-50sec_12harm.csv", delimiter=",")[354:5090]
    constants = np.array([joint.torque_constant_nm_per_a or 0.0 for joint in robot.joints])
    q = table[:, 1:7]
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    gravity_nm = regressor(model, q, np.zeros_like(q), np.zeros_like(q))
    gravity_nm = gravity_nm @ drawn_parameters(model, robot)
    return UserFiles(robot, table[:, 0], q, table[:, 13:19] * constants, gravity_nm)


def diagnose(stated: UserFiles, folder: Path) -> tuple[bool, set[tuple[str, tuple[str, ...]]]]:
    """Import and identify a recording with the commands.

    Returns:
        `refused`: True if a command ended with an error, or the import reported a finding.
        `named`: The (kind, joints) of each mistake that `identify` named, with its alternatives.
    """
    np.savetxt(folder / "rec.csv", stated.table, delimiter=",", fmt="%.9g")
    (folder / "robot.yaml").write_text(to_yaml(stated.robot))
    (folder / "map.yaml").write_text(stated.map_text)
    runs = ["--runs", str(folder / "runs"), "--json"]
    code, imported = _run(
        ["import", str(folder / "rec.csv"), "--map", str(folder / "map.yaml"), *runs]
    )
    if code != 0 or imported["findings"]:
        return True, set()
    code, document = _run(["identify", str(imported["folder"]), *runs])
    estimate = document.get("estimate") or {}
    found = estimate.get("mistakes") or []
    named = [each for mistake in found for each in (mistake, *mistake["alternatives"])]
    return code != 0, {(each["kind"], tuple(each["joints"])) for each in named}


def _run(words: list[str]) -> tuple[int, dict[str, Any]]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = run(words)
    return code, json.loads(out.getvalue() or "{}")


def outcomes(sound: UserFiles) -> Iterator[Outcome]:
    """Inject every mistake into a correct recording and yield the results."""
    truth = _trial(sound, sound.robot)
    assert truth is not None
    for made in mistakes(sound):
        with tempfile.TemporaryDirectory() as folder:
            refused, named = diagnose(made.stated, Path(folder))
        joints = tuple(sound.robot.joint_names[j] for j in made.joints)
        right = any((kind, joints) in named for kind in made.kinds)
        stated = _trial(made.stated, made.stated.robot)
        visible = made.shown or stated is None or truth.far_better_than(stated)
        yield Outcome(sound.robot.name, made.name, refused and not named, right, visible)


def _trial(stated: UserFiles, robot: RobotDescription) -> WiringTrial | None:
    """Return how well a robot file explains a recording; None if its time stamps are unusable."""
    recording = recording_of(stated, DEGREE if stated.unit == "deg" else 1.0)
    try:
        signals = WiredSignals.of(robot, [smooth_nonperiodic(recording, BAND_HZ)])
    except RidDaqError:
        return None
    return CondensedEquations.of(signals).trial(np.eye(len(robot.joints)))


def recording_of(stated: UserFiles, factor: float = 1.0) -> Recording:
    """Return the table as a `Recording`, its positions multiplied by a factor."""
    time_s, first = np.unique(stated.time_s, return_index=True)
    rows = len(first)
    return Recording(
        joint_names=stated.robot.joint_names,
        time_s=time_s,
        position=factor * stated.position[first],
        torque_nm=stated.torque_nm[first],
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.full(rows, -1, dtype=np.int64),
        source="import",
        robot_name=stated.robot.name,
        run_id="",
    )


def false_alarms(count: int, first_seed: int) -> int:
    """Return the number of correct runs with a finding; every second run lasts a few seconds."""
    found = 0
    for number, sound in enumerate(sound_runs(count, first_seed), start=first_seed):
        rows = slice(None)
        if number % 2:
            random = np.random.default_rng(number)
            start, length = random.uniform(0.0, 20.0), random.uniform(*SHORT_S)
            rows = slice(*np.searchsorted(sound.time_s, (start, start + length)).tolist())
        stated = UserFiles.of(sound, rows)
        signals = WiredSignals.of(sound.robot, [smooth_nonperiodic(recording_of(stated), BAND_HZ)])
        driving, weight = find_impossibilities(signals)
        heavy = weight is not None and not weight.is_plausible
        found += bool(find_mistakes(signals) or driving or heavy)
    return found


def main() -> int:
    """Try runs with and without injected mistakes, and print the results; return 0 if passed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sound", type=int, default=SOUND_RUNS, help="runs without a mistake")
    parser.add_argument("--plates", type=int, default=PLATES, help="force plates to try")
    parser.add_argument("--arms", nargs="*", default=ARMS, choices=ARMS, help="arms to try")
    parser.add_argument("--seed", type=int, default=0, help="first seed; with 0 the UR10e is real")
    options = parser.parse_args()
    every: list[Outcome] = []
    alarms = 0
    for sound in sources(tuple(options.arms), options.seed):
        with tempfile.TemporaryDirectory() as folder:
            alarms += diagnose(sound, Path(folder)) != (False, set())
        for outcome in outcomes(sound):
            every.append(outcome)
            _print(outcome)
    for plate in plate_outcomes(options.plates, options.seed):
        if plate.name == SOUND:
            alarms += plate.named
            continue
        refused = plate.refused and not plate.named
        of_plate = Outcome(plate.arm, f"plate: {plate.name}", refused, plate.named, plate.visible)
        every.append(of_plate)
        _print(of_plate)
    shown = [each for each in every if each.visible or each.refused]
    detected = [each for each in shown if each.refused or each.named]
    missed = Counter(each.name for each in shown if not (each.refused or each.named))
    alarms += false_alarms(options.sound, options.seed)
    share = len(detected) / max(len(shown), 1)
    document = {
        "kinds": len({each.name for each in every}),
        "made": len(every),
        "shown_by_data": len(shown),
        "detected": len(detected),
        "share": round(share, 3),
        "bar": DETECTED_BAR,
        "missed": dict(missed),
        "sound_runs": options.sound + options.plates + len(options.arms),
        "false_alarms": alarms,
    }
    print(json.dumps(document))
    return 0 if share >= DETECTED_BAR and alarms == 0 else 1


def _print(outcome: Outcome) -> None:
    result = "refused" if outcome.refused else "named" if outcome.named else "-"
    note = "" if outcome.visible or result != "-" else "the mistake has no effect on the data"
    print(f"{outcome.arm:8} {outcome.name:45} {result:8} {note}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
