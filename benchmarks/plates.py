"""Import of a force plate: agreement with the amplifier, own clocks, and wrong descriptions.

Run it with ``python -m benchmarks.plates [--quick]``. It uses the simulated cell ir361.

A run is recorded through the simulated amplifier. Its positions, torques and the rows of the plate
are written as CSV files, and imported with maps:
1. as recorded: the estimates must be those of the recorded run;
2. with a plate of its own clock: offset and rate must be in their 95 % intervals; the offset is
   known only modulo one period;
3. as six components, in kN and kN m, with the opposite sign;
4. with four wrong descriptions: the plate must be named, and not the robot.

Delay and clock are also estimated for other arms on other plates (`benchmarks.sound_plates`). The
joint axes of these arms differ at random from the robot file, with standard deviations of 2 mrad
and 1 mm. Delay, offset and rate must each be in their 95 % interval for at least 90 % of the arms.

The velocity loops are identified from a run of a multisine, and from the same data as CSV file.
"""

from __future__ import annotations

import csv
import json
import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from acquisition.imports.plate_report import NORMAL_95
from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.motion.samples import Phase
from acquisition.processing.plate_alignment import stream_clock
from acquisition.recording.plate_geometry import WRENCH_NAMES, plate_wrench_matrix
from acquisition.runs.catalogue import find_run
from benchmarks.foreign_loops import loop_differences
from benchmarks.loaded import Workplace
from benchmarks.short_form import is_short
from benchmarks.sound_plates import STEP_S, WeighedArm, weighed_arms
from benchmarks.sound_robots import ROBOTS
from config.arrays import FloatArray
from config.cell.plate import CHANNEL_NAMES
from identification.calibration.plate_timing import PlateTiming, estimate_plate_timing
from identification.estimation.file import read_estimate
from rid_daq.runs.run_data import RunData

SAME: Final = 1e-9
SAME_LOOP: Final = 1e-8
"""Largest relative difference of a fitted loop; the search ends with differences of about 1e-9."""
NEAR_SIGMA: Final = 0.1
"""Largest difference of an estimate from six components, in standard deviations: the drift of a
plate is a median, so that the sum of the drifts is not the drift of the sum."""
OWN_SIGMA: Final = 1.0
"""Largest difference of an estimate from resampled rows, in standard deviations."""
LEAST_HELD: Final = 0.9
KEYS: Final = {
    "plate size": "plate.b_m",
    "plate position": "plate.position_m",
    "channel sensitivity": "plate.scale",
    "plate rotation": "plate.rotation_rad",
}
"""The wrong key of the import map for each kind of mistake."""
LONGEST_DELAY_S: Final = 0.2
OFFSET_S, PPM = 1234.5, 80.0


@dataclass(frozen=True, eq=False)
class ForeignFiles:
    """CSV files of a recorded run, and the map that reads them.

    Attributes:
        work: Folder with the run.
        plate_s: Shape (rows,). Times of the plate's rows on the positions' clock [s].
        channels_n: Shape (rows, 8). Channels of the plate [N].
        base: Keys of the map, without the plate's columns.
        plate: Keys of the plate's description.
    """

    work: Workplace
    plate_s: FloatArray
    channels_n: FloatArray
    base: Mapping[str, Any]
    plate: Mapping[str, Any]

    @classmethod
    def of(cls, work: Workplace, label: str) -> ForeignFiles:
        """Write the positions and torques of a run; return the rows of its plate."""
        data = RunData.load(find_run(work.folder / "runs", label))
        recording = data.recording
        last_s = float(recording.time_s[-1])  # later rows are not used in simulated time
        rows = read_plate_journal(data.folder.file(PLATE_RECORDING)).until(last_s)
        plate = rows.header.plate
        (stream,) = np.unique(rows.stream).tolist()
        main = recording.phase == Phase.MAIN
        columns = (recording.time_s[main], recording.position[main], recording.torque_nm[main])
        names = ["time", *(f"{what}_{j}" for what in ("q", "tau") for j in recording.joint_names)]
        _write_csv(work.folder / "robot.csv", names, np.column_stack(columns))
        assert recording.samples_per_period is not None
        assert recording.sample_period_s is not None
        assert data.cell is not None
        torque_filter = data.cell.torque_filter
        base = {
            "name": "foreign",
            "robot": str(data.folder.file("robot.yaml")),
            "header_rows": 1,
            "time": {"column": "time"},
            "further_files": [{}],
            "torques": "motor_torque",
            "period_s": recording.samples_per_period * recording.sample_period_s,
            "joints": [
                {"joint": joint, "position": f"q_{joint}", "torque": f"tau_{joint}"}
                for joint in recording.joint_names
            ],
            "torque_filter": None if torque_filter is None else torque_filter.model_dump(),
        }
        described = plate.model_dump(mode="json")
        keys = ("a_m", "b_m", "az0_m", "position_m", "rotation_rad", "sensitivity")
        low_pass = {
            "order": plate.amplifier.low_pass_order,
            "cutoff_hz": plate.amplifier.low_pass_hz,
        }
        return cls(
            work,
            stream_clock(recording, rows, stream).to_sync(rows.device_s),
            rows.channels_n,
            base,
            {key: described[key] for key in keys} | {"low_pass": low_pass},
        )

    def imported(
        self,
        label: str,
        stamp_s: FloatArray,
        readings: FloatArray,
        names: Sequence[str],
        **plate: Any,
    ) -> dict[str, Any]:
        """Write the plate's file and a map, import them, and return the run's import report."""
        folder = self.work.folder
        file, path = folder / f"{label}.csv", folder / f"{label}.yaml"
        _write_csv(file, ["time", *names], np.column_stack([stamp_s, readings]))
        path.write_text(yaml.safe_dump({**self.base, "plate": plate}))
        words = ("import", str(folder / "robot.csv"), str(file), "--map", str(path))
        self.work(*words, "--label", label)
        found: dict[str, Any] = json.loads(find_run(folder / "runs", label).read("import.json"))[
            "plate"
        ]
        return found

    def as_recorded(self, label: str, **changes: Any) -> dict[str, Any]:
        """Import the plate's channels as recorded; `changes` replace keys of its description."""
        plate = {**self.plate, "channels": list(CHANNEL_NAMES), **changes}
        return self.imported(label, self.plate_s, self.channels_n, CHANNEL_NAMES, **plate)


def _write_csv(path: Path, names: Sequence[str], values: FloatArray) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(values.tolist())


def differences(work: Workplace, label: str, kind: str) -> tuple[float, float]:
    """Return the largest difference between two estimates.

    Returns:
        The difference relative to the largest parameter, and in standard deviations.
    """
    found = []
    for name in ("recorded", label):
        path = work.path(f"{name} {kind}.json")
        if not Path(path).exists():
            work("identify", name, "--model", kind, "-o", path, codes=(0, 6))
        found.append(read_estimate(Path(path)))
    recorded, imported = found
    off = np.abs(imported.values - recorded.values)
    return float(off.max() / np.abs(recorded.values).max()), float((off / recorded.sigma).max())


def wrong_descriptions(files: ForeignFiles) -> dict[str, dict[str, Any]]:
    """Return the wrong keys of the plate for each mistake."""
    x, y, z = files.plate["position_m"]
    roll, pitch, yaw = files.plate["rotation_rad"]
    wrong = [1.0] * len(CHANNEL_NAMES)
    wrong[4] = 1.2
    return {
        "plate size": {"b_m": files.plate["b_m"] - 0.05},
        "plate position": {"position_m": [x + 0.05, y, z]},
        "channel sensitivity": {"scale": wrong},
        "plate rotation": {"rotation_rad": [roll, pitch, yaw + math.pi / 2.0]},
    }


def own_clock_holds(files: ForeignFiles) -> bool:
    """Import a plate with another clock, and return True if its clock was found."""
    since = files.plate_s - files.plate_s.mean()
    stamp_s = OFFSET_S + since * (1.0 + 1e-6 * PPM)
    plate = {**files.plate, "channels": list(CHANNEL_NAMES), "clock": "own"}
    found = files.imported("own", stamp_s, files.channels_n, CHANNEL_NAMES, **plate)
    data = RunData.load(find_run(files.work.folder / "runs", "own"))
    row_s = data.recording.time_s
    middle_s = float(row_s[0] + row_s[-1]) / 2.0
    lag_s = OFFSET_S + (middle_s - files.plate_s.mean()) * (1.0 + 1e-6 * PPM) - middle_s
    period_s = files.base["period_s"] * (1.0 + 1e-6 * PPM)
    wrong_s = math.remainder(found["lag_found_s"] - lag_s, period_s)
    wrong_ppm = found["drift_ppm"] - PPM
    half_s, half_ppm = (NORMAL_95 * found[key] for key in ("lag_std_s", "drift_std_ppm"))
    _, sigmas = differences(files.work, "own", "combined")
    print(
        f"own clock: offset wrong by {1e3 * wrong_s:.3f} ± {1e3 * half_s:.3f} ms, rate by"
        f" {wrong_ppm:.1f} ± {half_ppm:.1f} ppm; estimates differ by {sigmas:.3f} sigma"
    )
    return abs(wrong_s) <= half_s and abs(wrong_ppm) <= half_ppm and sigmas <= OWN_SIGMA


def as_six_components(files: ForeignFiles) -> float:
    """Return the difference of an estimate from the wrench that the plate's software computes.

    It is in standard deviations.
    """
    sizes = (files.plate["a_m"], files.plate["b_m"], files.plate["az0_m"])
    crosstalk = np.array(files.plate["sensitivity"] or np.eye(len(CHANNEL_NAMES)))
    wrench = files.channels_n @ (plate_wrench_matrix(*sizes) @ np.linalg.inv(crosstalk)).T
    plate = {key: files.plate[key] for key in ("position_m", "rotation_rad", "low_pass")}
    plate |= {"wrench": list(WRENCH_NAMES), "unit": "kN", "moment_unit": "kNm"}
    plate |= {"exerted_on": "robot", "drift_limit_n_s": 1e3}
    files.imported("six", files.plate_s, -1e-3 * wrench, WRENCH_NAMES, **plate)
    return differences(files.work, "six", "external")[1]


def named_mistake(files: ForeignFiles, kind: str, changes: Mapping[str, Any]) -> bool:
    """Import with a wrong description; return True if the plate is named, and not the robot."""
    label = kind.replace(" ", "-")
    files.as_recorded(label, **changes)
    words = ("identify", label, "--model", "combined", "-o", files.work.path(f"{label}.json"))
    said = files.work(*words, codes=(6,))
    if "error" in said:  # the wrench does not resemble that of the robot, so there is no estimate
        sentence, of_robot = said["error"]["message"], []
        named = said["error"].get("code") == "RID-PLATE-MISTAKEN" and KEYS[kind] in sentence
    else:
        mistake = said["plate"].get("mistake") or {}
        sentence = mistake.get("sentence", "no mistake is named")
        of_robot = said["plate"]["torque_constants"] or said["estimate"].get("mistakes")
        named = mistake.get("kind") == kind and KEYS[kind] in sentence
    print(f"{kind}: {sentence}")
    return named and not of_robot


def timing_of(arm: WeighedArm, delay_s: float, rate: float, *, own_clock: bool) -> PlateTiming:
    """Return the estimated timing of a plate whose stamps have a delay and a rate."""
    recording, reaction = arm.recording, arm.recording.reaction
    assert reaction is not None
    since = recording.time_s - recording.time_s.mean()
    return estimate_plate_timing(
        replace(recording, reaction=None),
        arm.robot,
        recording.time_s + delay_s + rate * since,
        reaction.channels_n,
        reaction.valid,
        None,
        own_clock=own_clock,
    )


def intervals_hold(count: int) -> dict[str, float]:
    """Return the fraction of arms whose true delay, offset and rate are in their intervals."""
    held: dict[str, list[bool]] = {"delay": [], "offset": [], "rate": []}
    errors_s = []
    for seed, arm in enumerate(weighed_arms(count)):
        delay_s = float(np.random.default_rng([seed, 4]).uniform(0.0, LONGEST_DELAY_S))
        found = timing_of(arm, delay_s, 0.0, own_clock=False)
        errors_s.append(found.lag_s - delay_s)
        held["delay"].append(abs(errors_s[-1]) <= NORMAL_95 * found.lag_std_s)
        rate = 1e-6 * PPM
        found = timing_of(arm, OFFSET_S + delay_s, rate, own_clock=True)
        assert arm.recording.samples_per_period is not None
        period_s = arm.recording.samples_per_period * STEP_S
        off_s = math.remainder(found.lag_s - OFFSET_S - delay_s, period_s * (1.0 + rate))
        held["offset"].append(abs(off_s) <= NORMAL_95 * found.lag_std_s)
        held["rate"].append(abs(found.rate - rate) <= NORMAL_95 * found.rate_std)
    rms_ms = 1e3 * float(np.sqrt(np.mean(np.square(errors_s))))
    print(f"{count} arms: RMS error of the delay {rms_ms:.3f} ms")
    return {name: float(np.mean(each)) for name, each in held.items()}


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    quick = is_short(__doc__)
    with tempfile.TemporaryDirectory() as name:
        work = Workplace(Path(name), "ir361")
        work.excitation("excitation", 1, 4 if quick else 8)
        work.record("excitation", "recorded")
        files = ForeignFiles.of(work, "recorded")
        found = files.as_recorded("csv")
        kinds = ("external", "combined")
        differs = {kind: differences(work, "csv", kind)[0] for kind in kinds}
        print("through CSV and through the amplifier, estimates differ by", differs)
        half_s = NORMAL_95 * found["lag_std_s"]
        print(f"delay {1e3 * found['lag_found_s']:.3f} ± {1e3 * half_s:.3f} ms")
        clock = own_clock_holds(files)
        six = as_six_components(files)
        print(f"six components: estimates differ from those of the channels by {six:.1e} sigma")
        named = {
            kind: named_mistake(files, kind, changes)
            for kind, changes in wrong_descriptions(files).items()
        }
        loops = loop_differences(work)
        print("velocity loops through CSV differ by", loops)
    held = intervals_hold(len(ROBOTS) if quick else 50)
    print("share of true values in their 95 % intervals:", held)
    holds = max(differs.values()) <= SAME and clock and six <= NEAR_SIGMA and all(named.values())
    holds = holds and min(held.values()) >= LEAST_HELD and max(loops.values()) <= SAME_LOOP
    result = {
        "name": "plates",
        "value": max(differs.values()),
        "unit": "difference of estimates through CSV and through the amplifier, relative",
        "six_components_sigma": six,
        "named": named,
        "held": held,
        "loops": loops,
        "bar": f"difference at most {SAME:g}; clock in its interval; every mistake named;"
        f" intervals right for {LEAST_HELD:.0%} of the arms",
        "holds": bool(holds),
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
