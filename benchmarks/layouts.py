"""One real recording in the layouts of other programs: `python -m benchmarks.layouts --data DIR`.

DIR contains the recordings of a UR10e (folder ur10e). A part of one of them is written in the
layouts of `benchmarks.layout_files`. For most of them the program proposes the import map; the
person's confirmation is replaced by values that only a person knows (`?` in the proposal). For the
others the map is written by hand. Every layout must give the same positions, torques and model as
the original file: the largest difference, relative to the largest value, is at most 1e-6.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.maps.import_map import load_import_map
from benchmarks.layout_files import JOINTS, LAYOUTS, Layout, Source
from config.arrays import FloatArray
from config.formats.yaml_tree import dump_yaml
from config.refusals import PLACEHOLDER
from rid_daq.api import RidDaqError, identify, read_recording
from rid_daq.operations.experiment.map_proposal import propose_checked_map

FILE: Final = "ur10e/ur-20_02_12-50sec_12harm.csv"
ROWS: Final = slice(354, 5090)
ROBOT: Final = "ur10e"
LARGEST_DIFFERENCE: Final = 1e-6
FEWEST_LAYOUTS: Final = 30


def main() -> int:
    """Print one line per layout and the result; return 1 if a layout gives another model."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with ur10e/*.csv")
    parser.add_argument("--only", action="append", default=[], help="name of a layout; repeatable")
    arguments = parser.parse_args()
    source = Source.of(np.loadtxt(arguments.data / FILE, delimiter=",")[ROWS])
    wanted = [each for each in LAYOUTS if not arguments.only or each.name in arguments.only]
    with tempfile.TemporaryDirectory() as place:
        original = Path(place) / "original.csv"
        np.savetxt(original, source.rows, delimiter=",", fmt="%.17g")
        expected = {True: _values(original, "ur10e_31", ())}
        expected[False] = _values(original, _without_velocities(Path(place)), ())
        worst, failed, proposed = 0.0, [], 0
        for layout in wanted:
            folder = Path(place) / str(len(list(Path(place).iterdir())))
            folder.mkdir()
            began_s = time.monotonic()
            try:
                how, found = _read(layout, source, folder)
                difference = max(
                    float(np.abs(a - b).max() / np.abs(b).max())
                    for a, b in zip(found, expected[layout.has_velocity], strict=True)
                )
            except (RidDaqError, ValueError) as error:
                how, difference = f"{type(error).__name__}: {error}", float("inf")
            worst = max(worst, difference)
            proposed += how == "proposed"
            if not difference <= LARGEST_DIFFERENCE:
                failed.append(layout.name)
            took_s = time.monotonic() - began_s
            sys.stdout.write(f"{layout.name:<42}{how:<12}{difference:9.1e}{took_s:7.1f} s\n")
            sys.stdout.flush()
    passed = not failed and (bool(arguments.only) or len(wanted) >= FEWEST_LAYOUTS)
    result = {
        "layouts": len(wanted),
        "proposed": proposed,
        "largest_difference": worst,
        "bar": LARGEST_DIFFERENCE,
        "failed": failed,
        "passed": passed,
    }
    sys.stdout.write(json.dumps(result) + "\n")
    return 0 if passed else 1


def _without_velocities(folder: Path) -> Path:
    """Write an import map for the original file that does not use its velocities."""
    _, robot = load_import_map("ur10e_31")
    joints = [
        {"joint": joint, "position": 1 + i, "current": 13 + i} for i, joint in enumerate(JOINTS)
    ]
    keys = {"name": "still", "robot": robot.name, "columns": 31, "time": {"column": 0}}
    keys["torques"] = "motor_current"
    path = folder / "without_velocities.yaml"
    path.write_text(dump_yaml({**keys, "joints": joints}), encoding="utf-8")
    return path


def _read(layout: Layout, source: Source, folder: Path) -> tuple[str, tuple[FloatArray, ...]]:
    """Write and read one layout, and return how its map was made."""
    files = layout.write(folder, source)
    keys: dict[str, Any]
    if layout.keys is None:
        how, keys = "proposed", propose_checked_map(files[0], ROBOT).keys
    else:
        how, keys = (
            "by hand",
            {"name": "layout", "robot": ROBOT, "torques": "motor_torque", **layout.keys},
        )
    if keys["torques"] == PLACEHOLDER:
        keys["torques"] = "motor_torque"
    for number, joint in enumerate(keys.get("joints", ())):
        for key, value in joint.items():
            if value == PLACEHOLDER:
                joint[key] = layout.known[key][number]
    path = folder / "map.yaml"
    path.write_text(dump_yaml(keys), encoding="utf-8")
    return how, _values(files[0], path, files[1:])


def _values(file: Path, layout: str | Path, further: tuple[Path, ...]) -> tuple[FloatArray, ...]:
    """Return positions, torques and identified parameters."""
    recording = read_recording(file, *further, map=layout)
    model = identify(recording, diagnose=False)  # the search for mistakes changes no value
    return recording.position, recording.torque_nm, model.values


if __name__ == "__main__":
    sys.exit(main())
