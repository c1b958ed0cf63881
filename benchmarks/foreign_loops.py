"""Velocity loops of a simulated cell, identified from its run and from the same data as CSV file.

`benchmarks.plates` runs it. The import has other units than the recording, and no motion file.
"""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import yaml

from acquisition.motion.samples import Phase
from acquisition.runs.catalogue import find_run
from benchmarks.loaded import Workplace
from rid_daq.runs.run_data import RunData

PERIOD_S = "8"


def loop_differences(work: Workplace) -> dict[str, float]:
    """Return the relative differences of gains and integral times through CSV, by joint.

    A joint that has no loop in one of the two results has the difference infinity.
    """
    words = ("design", work.cell, "--kind", "multisine", "--realisations", "1")
    work(*words, "--period", PERIOD_S, "-o", work.path("multisine.yaml"), runs=False)
    work.record("multisine", "multisine")
    recorded = work("loop", "multisine", codes=(0, 6))
    data = RunData.load(find_run(work.folder / "runs", "multisine"))
    gain = _import(work, data)
    imported = work("loop", "imported", "--position-gain", str(gain), codes=(0, 6))
    of_import = {axis["joint"]: axis for axis in imported["axes"]}
    found = {}
    for axis in recorded["axes"]:
        other = of_import.get(axis["joint"])
        found[axis["joint"]] = (
            math.inf
            if other is None
            else max(abs(other[key] / axis[key] - 1.0) for key in ("gain", "integral_time_s"))
        )
    return found


def _import(work: Workplace, data: RunData) -> float:
    """Import the whole periods of a run in degrees; return the gain of its position loop [1/s]."""
    recording, cell = data.recording, data.cell
    assert cell is not None
    assert recording.velocity_command is not None
    assert recording.sample_period_s is not None
    main = recording.phase == Phase.MAIN
    columns = (
        recording.time_s[main],
        np.degrees(recording.position[main]),
        recording.torque_nm[main],
        np.degrees(recording.velocity_command[main]),
    )
    joints = recording.joint_names
    names = ["time", *(f"{what}_{joint}" for what in ("q", "tau", "v") for joint in joints)]
    file = work.folder / "multisine.csv"
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened)
        writer.writerow(names)
        writer.writerows(np.column_stack(columns).tolist())
    torque_filter = cell.torque_filter
    layout = {
        "name": "foreign",
        "robot": str(data.folder.file("robot.yaml")),
        "header_rows": 1,
        "time": {"column": "time"},
        "period_s": float(PERIOD_S),
        "torques": "motor_torque",
        "units": {"position": "deg", "velocity": "deg/s"},
        "joints": [
            {
                "joint": joint,
                "position": f"q_{joint}",
                "torque": f"tau_{joint}",
                "velocity_command": f"v_{joint}",
            }
            for joint in joints
        ],
        "command_timing": {"interpolation": "linear", "delay_s": recording.sample_period_s},
        "torque_filter": None if torque_filter is None else torque_filter.model_dump(),
    }
    path = Path(work.path("multisine-map.yaml"))
    path.write_text(yaml.safe_dump(json.loads(json.dumps(layout))))
    work("import", str(file), "--map", str(path), "--label", "imported")
    return cell.position_gain_per_s
