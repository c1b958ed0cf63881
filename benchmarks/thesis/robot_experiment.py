"""Experiments of chapters 3, 4 and 6 on ir361: identification on a force plate, path errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from acquisition.motion.samples import Phase
from acquisition.runs.catalogue import find_run
from benchmarks.loaded import Workplace
from benchmarks.paths import CIRCLES, FIRST, circle_text
from benchmarks.thesis.records import (
    Tree,
    curve,
    numbers,
    rounded,
    run_result,
    torque_curves,
    wrench_curves,
)
from config.load import load_cell, to_yaml
from identification.estimation.file import read_estimate
from identification.sensitivity.problem import root_mean_square
from identification.validation.base_wrench_validation import validate_base_wrench
from rid_daq.runs.motion_runs import MotionRun, read_motion_run

CELL: Final = "ir361_thesis"
PERIOD_S: Final = 9.6
"""Period of the excitation [s]; the thesis's 10 s are not a whole number of 6 ms cycles."""

CLASSICAL: Final = ("--friction-terms", "coulomb,viscous")
OTHER_CIRCLE: Final = "vertical circle of 30 cm at 0.5 m/s"


def robot_results(folder: Path, quick: bool) -> Tree:
    """Return excitation, accuracy of the parameters and prediction errors (chapters 3 and 4)."""
    work = Workplace(folder, CELL)
    loaded = load_cell(CELL)
    assert loaded.plant is not None
    assert loaded.plant.unmodelled is not None
    words = ("design", CELL, "-o", work.path("excitation.yaml"), "--harmonics", "5")
    periods = 3 if quick else 16
    times = ("--period", str(PERIOD_S), "--periods", str(periods))
    work(*words, *times, "--starts", "2", runs=False)
    points = {"kind": "multipoint", "robot": "ir361", "points": 20, "seed": 1}
    Path(work.path("points.yaml")).write_text(yaml.safe_dump(points))
    work.record("excitation", "excitation")
    work.record("points", "points")
    excited, through = (
        read_motion_run(find_run(folder / "runs", n)) for n in ("excitation", "points")
    )
    assert loaded.plant.unmodelled.kinematics is not None
    calibrated = loaded.robot.model_copy(update={"kinematics": loaded.plant.unmodelled.kinematics})
    (folder / "calibrated_robot.yaml").write_text(to_yaml(calibrated))
    config = loaded.config.model_copy(update={"robot": str(folder / "calibrated_robot.yaml")})
    (folder / "calibrated.yaml").write_text(to_yaml(config))
    known = Workplace(folder, work.path("calibrated.yaml"))
    known.record("excitation", "calibrated")
    known.record("points", "calibrated points")
    found: Tree = {"periods": periods}
    found["excitation"] = excitation(Path(work.path("excitation.yaml")), loaded.robot)
    planned = through.samples()
    found["points"] = {
        "time_s": curve(planned.sample_period_s * np.arange(len(planned))),
        "position_rad": [curve(each) for each in planned.position.T],
    }
    models: Tree = {}
    for name, run, options in (
        ("internal", "excitation", ()),
        ("without_rotors", "excitation", ("--no-rotors",)),
        ("calibrated", "calibrated", ()),
        ("external", "excitation", ("--model", "external")),
        ("combined", "excitation", ("--model", "combined")),
    ):
        words = ("identify", run, *options, "-o", work.path(f"{name}.json"), "--no-diagnose")
        document = work(*words, codes=(0, 6))
        fitted = run_result(folder, run)
        judged = "calibrated points" if name == "calibrated" else "points"
        other = work("validate", work.path(f"{name}.json"), judged, codes=(0, 1))
        models[name] = model_results(document, other)
        if name in ("internal", "without_rotors", "combined"):
            models[name]["excitation"] = torque_curves(fitted)
        if name in ("external", "combined"):
            models[name]["excitation_wrench"] = mean_wrench(excited, work.path(f"{name}.json"))
        if name == "combined":
            models["deviations"] = deviations(document["plate"]["improvement"]["parameters"])
            judged_result = run_result(folder, judged)
            models[name]["points"] = torque_curves(judged_result)
            models[name]["points_wrench"] = wrench_curves(judged_result["reaction"])
    return found | models


def excitation(path: Path, robot: Any) -> Tree:
    """Return condition number, crest factors and curves of a designed excitation."""
    motion = FourierMotion.require(load_motion(path), "the excitation is periodic")
    trajectory = motion.trajectory(robot, 0.006)
    time_s = trajectory.sample_times_s
    v = trajectory.velocity(time_s)
    text = path.read_text().splitlines()[1]
    return {
        "condition": float(text.split("Condition number ")[1].split(";")[0]),
        "velocity_crest": numbers(np.abs(v).max(axis=0) / np.sqrt(np.mean(v**2, axis=0))),
        "time_s": curve(time_s),
        "position_rad": [curve(each) for each in trajectory.position(time_s).T],
    }


def model_results(document: Tree, other: Tree) -> Tree:
    """Return the results of an identified model and of its validation on the random points."""
    estimate = document["estimate"]
    names = [each["name"] for each in estimate["parameters"]]
    rigid = [name for name in names if name[:3] not in ("fc_", "fv_", "k_s", "P0_")]
    found: Tree = {
        "links": len([name for name in rigid if not name.startswith("Im")]),
        "rigid": len(rigid),
        "condition": rounded(estimate["condition_number"]),
        "excitation_nm": numbers([each["residual"] for each in estimate["axes"]]),
        "points_nm": numbers([each["rms_error"] for each in other["validation"]["axes"]]),
    }
    if other.get("reaction"):
        parts = other["reaction"]["components"]
        found["wrench"] = numbers([each["rms_error"] for each in parts])
        found["wrench_percent"] = numbers([each["relative_error_percent"] for each in parts])
    return found


def deviations(parameters: list[Tree]) -> list[Tree]:
    """Return the standard deviations of parameters that torques and plate both determine."""
    kept = []
    for each in parameters:
        three = [each[f"std_{name}"] for name in ("internal", "external", "combined")]
        if all(three):
            kept.append({"words": each["words"], "unit": each["unit"], "std": numbers(three)})
    return kept


def mean_wrench(run: MotionRun, model: str) -> Tree:
    """Return measured and predicted base wrench of the excitation, means of all measured periods.

    Args:
        run: The excitation run.
        model: File of an external or combined model.
    """
    recording = run.data.recording
    rows = recording.samples_per_period
    assert rows is not None
    compared = validate_base_wrench(read_estimate(Path(model)), recording)
    main_s = recording.time_s[recording.phase == Phase.MAIN]
    periods = len(main_s) // rows
    last = int(np.searchsorted(compared.time_s, main_s[-1], side="right"))
    whole = slice(last - periods * rows, last)
    measured, predicted = (
        each[whole].reshape(periods, rows, 6).mean(axis=0)
        for each in (compared.measured, compared.predicted)
    )
    error, size = root_mean_square(measured - predicted), root_mean_square(measured)
    assert compared.noise is not None
    return {
        "rms": numbers(error),
        "percent": numbers(100.0 * error / size),
        "noise_percent": numbers(100.0 * compared.noise / size),
        "time_s": curve(np.arange(rows) * PERIOD_S / rows),
        "measured": [curve(each) for each in measured.T],
        "predicted": [curve(each) for each in predicted.T],
    }


def path_results(folder: Path, quick: bool) -> Tree:
    """Return velocity loops, and path errors without and with compensation (chapter 6).

    The folder has the excitation run of `robot_results`. The first circle tunes the compensation;
    the other circle is used for its validation only.
    """
    config = load_cell(CELL).config.model_copy(update={"plate": None, "name": "arm"})
    (folder / "arm.yaml").write_text(to_yaml(config))
    work = Workplace(folder, str(folder / "arm.yaml"))
    work("design", work.cell, "--kind", "multisine", "-o", work.path("multisine.yaml"), runs=False)
    work.record("multisine", "multisine")
    loop = work("loop", "multisine", "-o", work.path("loops.json"))
    models: dict[str, tuple[str, ...]] = {"classical": CLASSICAL, "chosen": ("--choose",)}
    turns = 3 if quick else 15
    found: Tree = {"turns": turns, "loop": loop_results(loop["axes"][0])}
    circles = {"circle": CIRCLES[FIRST], "other": CIRCLES[OTHER_CIRCLE]}
    for circle, own in circles.items():
        Path(work.path(f"{circle}.yaml")).write_text(circle_text(own, turns))
        work.record(circle, f"{circle} plain")
    for model, options in models.items():
        file = work.path(f"{model}.json")
        words = ("identify", "excitation", *options, "-o", file, "--no-diagnose")
        work(*words, codes=(0, 6))
        for circle in circles:
            label, ahead = f"{circle} {model}", work.path(f"{circle}-{model}.json")
            words = ("compensate", work.cell, work.path(f"{circle}.yaml"), "--model", file)
            more = ("--loop", work.path("loops.json"), "--reference", "circle plain")
            work(*words, *more, "-o", ahead)
            work.record(circle, label, "--feedforward", ahead)
            motion = work("tracking", label, "--against", f"{circle} plain")["motions"][0]
            found[f"{circle}_plain"] = path_error(motion["against"])
            found[f"{circle}_{model}"] = path_error(motion)
        if model == "classical":
            found["curves"] = path_curves(run_result(folder, "circle classical"))
    return found


def reversal_results(folder: Path) -> Tree:
    """Return tracking error and velocity of axis 3 over one turn without compensation (figure 6.6).

    The folder has the circle of `path_results` without compensation.
    """
    recording = read_motion_run(find_run(folder / "runs", "circle plain")).data.recording
    assert recording.target_position is not None
    assert recording.sample_period_s is not None
    assert recording.samples_per_period is not None
    turn = np.flatnonzero(recording.phase == Phase.MAIN)[-recording.samples_per_period :]
    target, reached = recording.target_position[:, 2], recording.position[:, 2]
    velocity = np.gradient(target, recording.sample_period_s)[turn]
    error_mrad = 1e3 * (target - reached)[turn]
    return {
        "time_s": curve(recording.sample_period_s * np.arange(len(turn))),
        "velocity_rad_s": curve(velocity),
        "error_mrad": curve(error_mrad),
    }


def loop_results(axis: Tree) -> Tree:
    """Return gain, integral time and response of a velocity loop up to 5 Hz, as in figure 6.4."""
    found: Tree = {
        "gain_nm_s": rounded(axis["gain"]),
        "integral_time_s": rounded(axis["integral_time_s"]),
    }
    for name, response in (("measured", axis["response"]), ("model", axis["response"]["fit"])):
        hz = np.array(response["frequency_hz"])
        low = hz <= 5.0
        found[name] = {
            "frequency_hz": curve(hz[low]),
            "magnitude_db": curve(20.0 * np.log10(np.array(response["magnitude"])[low])),
            "phase_deg": curve(np.array(response["phase_deg"])[low]),
        }
    return found


def path_error(motion: Tree) -> Tree:
    """Return a motion's path error [mm] and its joint peaks [mrad]."""
    peaks = motion["joint_peak"]
    values = peaks.values() if isinstance(peaks, dict) else peaks
    return {
        "mean_mm": rounded(1e3 * motion["mean_m"]),
        "max_mm": rounded(1e3 * motion["max_m"]),
        "peaks_mrad": numbers([1e3 * each for each in values]),
    }


def path_curves(result: Tree) -> Tree:
    """Return joint and path errors of one turn without and with compensation."""
    drawn = result["tracking"]["motions"][0]["drawn"]
    found: Tree = {}
    for name, key in (("plain", "before"), ("compensated", "after")):
        one = drawn[key]
        found[name] = {
            "time_s": curve(one["time_s"]),
            "joint_mrad": [curve(1e3 * np.array(each)) for each in one["joint"]],
            "deviation_mm": [curve(1e3 * np.array(each)) for each in one["deviation_m"]],
        }
    return found
