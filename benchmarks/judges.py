"""Published recordings of real robots: `python -m benchmarks.judges --data DIR`.

A file `judge.yaml` describes the data of a robot: the recordings, their import map, and which of
them train and which validate (`benchmarks.judge_split`). It is in a folder below DIR, or is a
bundled file with the folder's name. The data go through the commands `import`, `identify`,
`identify --choose` and `validate`. Then the training and the validation recordings are exchanged.

The output contains the prediction errors with their accuracy and causes (`benchmarks.judged_rows`),
the number of rigid base parameters whose 95 % intervals agree between both directions, and the
physical consistency of the models. With `--peer-python PYTHON`, figaroh identifies the same arrays
in that Python. The last line is one JSON object.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same value as in the program

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.runs.catalogue import find_runs
from benchmarks.judge_split import JudgeSplit, Piece, find_splits
from benchmarks.judged_rows import JudgedErrors, judge_rows
from dynamics.geometry.kinematics import Chain
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.file import read_estimate
from rid_daq.runs.run_data import RunData

PEER: Final = Path(__file__).with_name("judges_peer.py")
BAND_HZ: Final = 10.0
TWO_SIGMA: Final = 1.96


class CommandError(Exception):
    """A command that ended with an error; the message is the last line of its output."""


@dataclass
class Direction:
    """Results of one direction: training on some recordings, prediction of the others.

    Attributes:
        plain, moving, every: Largest relative error of each joint in the predicted runs [%].
            `plain`: with the terms of the robot file, on moving samples. `moving`, `every`: with
            the chosen terms, on moving and on all samples.
        judged: Errors of each predicted run with the chosen terms, by `judge_rows`.
        peer: Error of figaroh on moving samples; empty without it.
        consistent: True if the data do not refute that the chosen model's parameters are
            physically consistent.
        values: Value and standard deviation of each rigid base parameter.
    """

    plain: list[float] = field(default_factory=list)
    moving: list[float] = field(default_factory=list)
    every: list[float] = field(default_factory=list)
    judged: list[JudgedErrors] = field(default_factory=list)
    peer: list[float] = field(default_factory=list)
    consistent: bool = False
    values: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def sigma(self) -> list[float]:
        """Standard deviation of `moving`: of each joint in the run with its largest error [%]."""
        worst = np.argmax([run.moving_percent for run in self.judged], axis=0)
        return [float(self.judged[run].sigma_percent[j]) for j, run in enumerate(worst)]

    @property
    def away(self) -> list[float]:
        """Largest error of each joint on rows away from standstill [%]."""
        return list(np.max([run.away_percent for run in self.judged], axis=0))

    @property
    def own_friction(self) -> list[float]:
        """Largest error of each joint with the friction of the predicted run [%]."""
        return list(np.max([run.own_friction_percent for run in self.judged], axis=0))


def command(*words: str) -> dict[str, Any]:
    """Run a command with `--json` and return its document; exit 1 and 6 are verdicts.

    Raises:
        CommandError: It ended with an error, or without a document.
    """
    done = subprocess.run(
        [sys.executable, "-m", "rid_daq", *words, "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    try:
        document: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        message = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise CommandError(f"{words[0]}, exit {done.returncode}: {message}") from None
    if "error" in document:
        raise CommandError(f"{words[0]}, exit {done.returncode}: {document['error']['message']}")
    return document


def import_pieces(place: Path, which: str, split: JudgeSplit, pieces: Sequence[Piece]) -> list[str]:
    """Import recordings of a folder, or parts of recordings; return the labels of the runs."""
    own = place / split.map
    bound = str(own) if own.is_file() else split.map
    labels = []
    for number, piece in enumerate(pieces):
        labels.append(f"{which}{number}")
        rows = ["--rows", piece.rows] if piece.rows else []
        command("import", str(place / piece.file), "--map", bound, *rows, "--label", labels[-1])
    return labels


def largest_errors(validations: Sequence[dict[str, Any]], key: str) -> list[float]:
    """Return the largest error of each joint in several validations [%]."""
    tables = [[axis[key] for axis in each["validation"]["axes"]] for each in validations]
    return [max(column) for column in zip(*tables, strict=True)]


def evaluate_direction(way: str, train: Sequence[str], judge: Sequence[str]) -> Direction:
    """Identify with the robot file's terms and with chosen terms; predict the other runs."""
    result = Direction()
    for kind in ("plain", "chosen"):
        model = f"{way}_{kind}.json"
        document = command(
            "identify", *train, *(["--choose"] if kind == "chosen" else []), "-o", model
        )
        judged = [command("validate", model, run) for run in judge]
        if kind == "plain":
            result.plain = largest_errors(judged, "relative_error_percent")
            continue
        result.moving = largest_errors(judged, "relative_error_percent")
        result.every = largest_errors(judged, "all_samples_percent")
        estimate = read_estimate(Path(model))
        runs = [RunData.load(folder) for folder in find_runs(Path("runs"), judge)]
        result.judged = [judge_rows(estimate, run.recording) for run in runs]
        joints = [axis["joint"] for axis in document["estimate"]["axes"]]
        result.values = {
            each["name"]: (each["value"], each["std"])
            for each in document["estimate"]["parameters"]
            if not each["name"].endswith(tuple(f"_{joint}" for joint in joints))
        }
        result.consistent = document["estimate"]["consistency"]["consistent"]
    return result


def count_agreements(first: Direction, second: Direction) -> tuple[int, int]:
    """Return the rigid base parameters that agree within 95 % intervals, and their total number."""
    common = first.values.keys() & second.values.keys()
    agree = [
        abs(first.values[name][0] - second.values[name][0])
        <= TWO_SIGMA * math.hypot(first.values[name][1], second.values[name][1])
        for name in common
    ]
    return sum(agree), len(agree)


def write_arrays(runs: Sequence[str], to: Path) -> Path:
    """Write the low-passed arrays of some runs for figaroh; return the file."""
    data = [RunData.load(folder) for folder in find_runs(Path("runs"), runs)]
    signals: list[SmoothedSignals] = [smoothed_recording(each.recording, BAND_HZ) for each in data]
    robot = data[0].robot
    np.savez(
        to,
        allow_pickle=False,
        q=np.concatenate([each.position for each in signals]),
        v=np.concatenate([each.velocity for each in signals]),
        a=np.concatenate([each.acceleration for each in signals]),
        tau=np.concatenate([each.torque_nm for each in signals]),
        rows=Chain.from_description(robot).rows,
        gravity=np.array(robot.gravity_m_s2),
    )
    return to


def peer_percent(python: str, train: Sequence[str], judge: Sequence[str]) -> list[float]:
    """Return figaroh's largest error of each joint [%]; empty if it fails."""
    given = write_arrays(train, Path("train.npz"))
    tables = []
    for run in judge:
        words = [python, str(PEER), str(given), str(write_arrays([run], Path("judge.npz")))]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        if done.returncode:
            message = (done.stderr.strip().splitlines() or ["no message"])[-1]
            print(f"figaroh cannot run in {python}: {message}")
            return []
        tables.append(json.loads(done.stdout.splitlines()[-1]))
    return [max(column) for column in zip(*tables, strict=True)]


def percent_row(percent: Sequence[float]) -> str:
    """Return a row of percentages."""
    return " ".join(f"{each:5.1f}" for each in percent)


def meets_bar(percent: Sequence[float], bar: Sequence[float | None]) -> bool:
    """Return True if no joint exceeds its limit `bar`."""
    return all(limit is None or value <= limit for value, limit in zip(percent, bar, strict=False))


def judge_robot(place: Path, split: JudgeSplit, peer: str | None) -> dict[str, Any]:
    """Evaluate one robot in both directions, in the working folder, and print its table."""
    train, judge = (
        import_pieces(place, which, split, pieces)
        for which, pieces in (("train", split.train), ("judge", split.judge))
    )
    ways = {"first": (train, judge), "back": (judge, train)}
    result = {way: evaluate_direction(way, *runs) for way, runs in ways.items()}
    print(f"\n{place.name}: relative error of each joint [%]")
    for way, runs in ways.items():
        direction = result[way]
        if peer:
            direction.peer = peer_percent(peer, *runs)
        print(f"  {way:5}  terms of the robot file, moving   {percent_row(direction.plain)}")
        print(f"  {'':5}  chosen terms, moving              {percent_row(direction.moving)}")
        print(f"  {'':5}    their standard deviation        {percent_row(direction.sigma)}")
        print(f"  {'':5}    with the friction of this run   {percent_row(direction.own_friction)}")
        print(f"  {'':5}  chosen terms, away from rest      {percent_row(direction.away)}")
        print(f"  {'':5}  chosen terms, all samples         {percent_row(direction.every)}")
        if direction.peer:
            print(f"  {'':5}  figaroh, moving                   {percent_row(direction.peer)}")
        print(f"  {'':5}  physically consistent: {'not refuted' if direction.consistent else 'no'}")
    agree, of = count_agreements(*result.values())
    print(f"  {agree} of {of} rigid base parameters agree between the directions (95 % intervals)")
    first = result["first"]
    holds = meets_bar(first.moving, split.bar.moving_percent)
    holds &= meets_bar(first.away, split.bar.away_percent)
    holds &= meets_bar(first.every, split.bar.all_percent)
    return {
        "moving_percent": [round(each, 2) for each in first.moving],
        "sigma_percent": [round(each, 2) for each in first.sigma],
        "own_friction_percent": [round(each, 2) for each in first.own_friction],
        "away_percent": [round(each, 2) for each in first.away],
        "all_percent": [round(each, 2) for each in first.every],
        "back_moving_percent": [round(each, 2) for each in result["back"].moving],
        "figaroh_percent": first.peer,
        "parameters_that_agree": f"{agree} of {of}",
        "consistent": all(each.consistent for each in result.values()),
        "holds": holds,
    }


def main() -> int:
    """Evaluate every robot and print; the last line is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.judges")
    parser.add_argument("--data", type=Path, required=True, metavar="DIR")
    parser.add_argument("--peer-python", metavar="PYTHON", help="a Python that has figaroh")
    options = parser.parse_args()
    try:
        splits = find_splits(options.data.resolve())
    except ValueError as error:
        parser.error(str(error))
    if not splits:
        parser.error(
            f"no folder below {options.data} has a judge.yaml or the name of a bundled split"
        )
    robots: dict[str, dict[str, Any]] = {}
    for place, split in splits.items():
        with tempfile.TemporaryDirectory() as folder:
            here = Path.cwd()
            os.chdir(folder)
            try:
                robots[place.name] = judge_robot(place, split, options.peer_python)
            except CommandError as refusal:
                print(f"\n{place.name}: {refusal}")
                robots[place.name] = {"refused": str(refusal), "holds": False}
            finally:
                os.chdir(here)
    held = sum(bool(each["holds"]) for each in robots.values())
    print(
        json.dumps(
            {
                "name": "judges",
                "value": held,
                "unit": f"of {len(robots)} robots within their limits",
                "robots": robots,
                "bar": "every robot within the bar of its split, if it has one",
                "holds": held == len(robots),
            }
        )
    )
    return 0 if held == len(robots) else 1


if __name__ == "__main__":
    sys.exit(main())
