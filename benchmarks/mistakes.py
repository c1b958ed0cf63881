"""Which mistakes in files and wiring are told: `python -m benchmarks.mistakes`.

Every mistake is made in a recording that the commands read and identify, as a user would: on
invented three- and six-axis arms with effects that no model has and, where `RID_DAQ_DATA` names
the recordings, on a real UR10e. A mistake is told where a command refuses it, or where `identify`
names its kind and its joints. The data show a mistake at all where the truth explains them far
better than what was stated; the others are listed. The sound recordings go through the commands
first: nothing may be told of them, or any mistake in them would count as told. Then sound runs,
half of them 4 to 9 s long, are searched for mistakes: none may be found. `--sound` and `--arms` set
how much is tried; the last line is one JSON object.
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
from benchmarks.mistakes_made import DEGREE, Stated, mistakes
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

TOLD_BAR: Final = 0.95
SHORT_S: Final = (4.0, 9.0)
SOUND_RUNS: Final = 200
PLATES: Final = 12
ARMS: Final = ("ir361", "kr15", "ur10e")


@dataclass(frozen=True)
class Outcome:
    """What became of a mistake: refused with an exit status, named by `identify`, or neither."""

    arm: str
    name: str
    refused: bool
    named: bool
    visible: bool


def sources(arms: tuple[str, ...], first_seed: int) -> Iterator[Stated]:
    """Yield sound recordings of the arms; of a UR10e a real one, if there is one."""
    for arm in arms:
        robot = load_robot(arm)
        real = os.environ.get("RID_DAQ_DATA")
        if arm == "ur10e" and real is not None and first_seed == 0:
            yield _real(Path(real) / "ur10e")
            continue
        sound = sound_run(robot, np.random.default_rng([first_seed, ARMS.index(arm)]))
        yield Stated.of(sound)


def _real(folder: Path) -> Stated:
    """Return a real UR10e's recording."""
    robot = load_robot("ur10e")
    table = np.loadtxt(folder / "ur-20_02_12-50sec_12harm.csv", delimiter=",")[354:5090]
    constants = np.array([joint.torque_constant_nm_per_a or 0.0 for joint in robot.joints])
    q = table[:, 1:7]
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    gravity_nm = regressor(model, q, np.zeros_like(q), np.zeros_like(q))
    gravity_nm = gravity_nm @ drawn_parameters(model, robot)
    return Stated(robot, table[:, 0], q, table[:, 13:19] * constants, gravity_nm)


def tell(stated: Stated, folder: Path) -> tuple[bool, set[tuple[str, tuple[str, ...]]]]:
    """Import and identify a recording by the commands.

    Returns:
        `refused`. Whether a command refused it, or called the fit bad.
        `named`: Set of (kind, joints). What `identify` named, alternatives too.
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
    told = [each for mistake in found for each in (mistake, *mistake["alternatives"])]
    return code != 0, {(each["kind"], tuple(each["joints"])) for each in told}


def _run(words: list[str]) -> tuple[int, dict[str, Any]]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = run(words)
    return code, json.loads(out.getvalue() or "{}")


def outcomes(sound: Stated) -> Iterator[Outcome]:
    """Yield what became of every mistake made in a sound recording."""
    truth = _trial(sound, sound.robot)
    assert truth is not None
    for made in mistakes(sound):
        with tempfile.TemporaryDirectory() as folder:
            refused, named = tell(made.stated, Path(folder))
        joints = tuple(sound.robot.joint_names[j] for j in made.joints)
        right = any((kind, joints) in named for kind in made.kinds)
        stated = _trial(made.stated, made.stated.robot)
        visible = made.shown or stated is None or truth.far_better_than(stated)
        yield Outcome(sound.robot.name, made.name, refused and not named, right, visible)


def _trial(stated: Stated, robot: RobotDescription) -> WiringTrial | None:
    """Return how well a robot explains a recording; None where stamps of it leave nothing."""
    recording = recording_of(stated, DEGREE if stated.unit == "deg" else 1.0)
    try:
        signals = WiredSignals.of(robot, [smooth_nonperiodic(recording, BAND_HZ)])
    except RidDaqError:
        return None
    return CondensedEquations.of(signals).trial(np.eye(len(robot.joints)))


def recording_of(stated: Stated, factor: float = 1.0) -> Recording:
    """Return what is stated as a recording, its positions times a factor."""
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
    """Return in how many sound runs, every second cut to a few seconds, anything is wrong."""
    found = 0
    for number, sound in enumerate(sound_runs(count, first_seed), start=first_seed):
        rows = slice(None)
        if number % 2:
            random = np.random.default_rng(number)
            start, length = random.uniform(0.0, 20.0), random.uniform(*SHORT_S)
            rows = slice(*np.searchsorted(sound.time_s, (start, start + length)).tolist())
        stated = Stated.of(sound, rows)
        signals = WiredSignals.of(sound.robot, [smooth_nonperiodic(recording_of(stated), BAND_HZ)])
        driving, weight = find_impossibilities(signals)
        heavy = weight is not None and not weight.is_plausible
        found += bool(find_mistakes(signals) or driving or heavy)
    return found


def main() -> int:
    """Make the mistakes, search the sound runs, print both; 0 where the bars hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sound", type=int, default=SOUND_RUNS, help="sound runs to search")
    parser.add_argument("--plates", type=int, default=PLATES, help="force plates to try")
    parser.add_argument("--arms", nargs="*", default=ARMS, choices=ARMS, help="arms to try")
    parser.add_argument("--seed", type=int, default=0, help="first seed; 0 has the real UR10e")
    options = parser.parse_args()
    every: list[Outcome] = []
    alarms = 0
    for sound in sources(tuple(options.arms), options.seed):
        with tempfile.TemporaryDirectory() as folder:
            alarms += tell(sound, Path(folder)) != (False, set())
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
    told = [each for each in shown if each.refused or each.named]
    missed = Counter(each.name for each in shown if not (each.refused or each.named))
    alarms += false_alarms(options.sound, options.seed)
    share = len(told) / max(len(shown), 1)
    document = {
        "kinds": len({each.name for each in every}),
        "made": len(every),
        "shown_by_data": len(shown),
        "told": len(told),
        "share": round(share, 3),
        "bar": TOLD_BAR,
        "missed": dict(missed),
        "sound_runs": options.sound + options.plates + len(options.arms),
        "false_alarms": alarms,
    }
    print(json.dumps(document))
    return 0 if share >= TOLD_BAR and alarms == 0 else 1


def _print(outcome: Outcome) -> None:
    said = "refused" if outcome.refused else "named" if outcome.named else "-"
    seen = "" if outcome.visible or said != "-" else "the data do not show it"
    print(f"{outcome.arm:8} {outcome.name:45} {said:8} {seen}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
