"""Experiments of chapter 5 and of section 3.7.5: friction and payloads of the six-axis robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from benchmarks.loaded import Workplace
from benchmarks.thesis.records import Tree, curve, numbers, rounded, run_result, torque_curves
from config.load import LoadedCell, load_cell, to_yaml
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.payload.body import PayloadBody
from identification.sensitivity.cases import OTHER_PHASES, SHARE, thesis_motion
from identification.sensitivity.problem import (
    Assumptions,
    SensitivityProblem,
    prediction_error,
    root_mean_square,
)

PERIOD_S: Final = 30.0
HIGH: Final = 20
WARM_K: Final = 315.15
SPEEDS: Final = {
    "axis1": (2.6, (0.1, 0.6, 1.4, 2.3)),
    "axis4": (4.0, (0.1, 0.4, 1.0, 2.2, 4.0)),
    "axis6": (5.0, (0.2, 0.8, 2.5, 5.0, 8.0)),
}
"""Reach [rad] and speeds [rad/s] of the friction measurement: the axes of figures 3.9 to 3.12."""

ACCURATE: Final = ("--mass-limit", "20", "--centre-limit", "60", "--inertia-limit", "400")
"""Limits of the verdict, wide enough for an estimate that the thesis's motion determines poorly."""


def cell_at(folder: Path, name: str, temperature_k: float) -> Workplace:
    """Write a cell like kr15 whose motors start at a temperature; return its workplace.

    Args:
        folder: Folder of the cell file.
        name: Name of the file.
        temperature_k: Temperature of all motors at the start [K].
    """
    loaded = load_cell("kr15")
    assert loaded.plant is not None
    assert loaded.plant.unmodelled is not None
    effects = []
    for axis in loaded.plant.unmodelled.axes:
        assert axis.thermal is not None
        thermal = axis.thermal.model_copy(update={"initial_k": temperature_k})
        effects.append(axis.model_copy(update={"thermal": thermal}))
    unmodelled = loaded.plant.unmodelled.model_copy(update={"axes": tuple(effects)})
    plant = loaded.plant.model_copy(update={"unmodelled": unmodelled})
    (folder / f"{name}_plant.yaml").write_text(to_yaml(plant))
    config = loaded.config.model_copy(update={"plant": str(folder / f"{name}_plant.yaml")})
    (folder / f"{name}.yaml").write_text(to_yaml(config))
    return Workplace(folder, str(folder / f"{name}.yaml"), limit_fraction="0.5")


def friction_results(folder: Path) -> Tree:
    """Return friction curves: cold, warm, and with the medium payload (figures 3.9 to 3.12)."""
    motion = ConstantVelocityMotion.model_validate(
        {
            "kind": "constant_velocity",
            "robot": "kr15",
            "pose": (0.0,) * 6,
            "joints": tuple(
                {"joint": name, "low": -reach, "high": reach, "speeds": speeds}
                for name, (reach, speeds) in SPEEDS.items()
            ),
            "longest_run_s": 2.0,
        }
    )
    (folder / "speeds.yaml").write_text(to_yaml(motion))
    found: Tree = {}
    for name, start_k, more in (
        ("cold", 298.15, ()),
        ("warm", WARM_K, ()),
        ("loaded", WARM_K, ("--mounted", "medium")),
    ):
        work = cell_at(folder, name, start_k)
        work.record("speeds", name, *more)
        document = work("friction", name, codes=(0, 6))
        found[name] = {
            joint["joint"]: friction_curve(joint) for joint in document["friction"]["joints"]
        }
    return found


def friction_curve(joint: Tree) -> Tree:
    """Return a joint's friction curve, and the errors of the fitted models [N m].

    A model with as many coefficients as speeds fits every curve, so its error is left out.
    """
    speeds = joint["curve"]["speed"]
    return {
        "speed_rad_s": numbers(speeds),
        "friction_nm": numbers(joint["curve"]["odd"]),
        "std_nm": numbers(joint["curve"]["odd_std"]),
        "rms_nm": {
            fit["name"]: rounded(fit["rms"])
            for fit in joint["fits"]
            if len(fit["parameters"]) < len(speeds)
        },
    }


def payload_motion(
    loaded: LoadedCell,
    seed: int,
    periods: int,
    first_axis: int,
    *,
    period_s: float = PERIOD_S,
    high: int = HIGH,
) -> FourierMotion:
    """Return a motion of the kind of section 5.6: two harmonics, 1 and 20 of a period of 30 s.

    Args:
        loaded: The cell, for the limits.
        seed: Random seed of the phases.
        periods: Number of measured periods.
        first_axis: First axis that moves, from 0.
        period_s: Period [s].
        high: Number of the higher harmonic.
    """
    random = np.random.default_rng(seed)
    joints = []
    for j, joint in enumerate(loaded.robot.joints):
        limits = joint.limits
        middle = (limits.position_max + limits.position_min) / 2.0
        reach = min((limits.position_max - limits.position_min) / 2.0, np.pi)
        slow, fast = 2.0 * np.pi / period_s, 2.0 * np.pi * high / period_s
        sizes = np.zeros(high)
        sizes[0] = min(0.4 * reach, 0.4 * limits.velocity / slow)
        sizes[-1] = 0.25 * min(reach, limits.velocity / fast, limits.acceleration / fast**2)
        phases = random.uniform(0.0, 2.0 * np.pi, high)
        sizes *= 0.0 if j < first_axis else 1.0
        joints.append(
            FourierJoint(
                joint=joint.name,
                offset=0.0 if j < first_axis else middle,
                sine=tuple((sizes * np.cos(phases)).tolist()),
                cosine=tuple((sizes * np.sin(phases)).tolist()),
            )
        )
    return FourierMotion(
        kind="fourier",
        robot=loaded.robot.name,
        period_s=period_s,
        periods=periods,
        joints=tuple(joints),
    )


def payload_results(folder: Path, quick: bool) -> Tree:
    """Return payload estimates of both procedures, and torque errors on another motion."""
    loaded = load_cell("kr15")
    assert loaded.plant is not None
    work = cell_at(folder, "kr15_warm", WARM_K)
    periods = 2 if quick else 4
    motions = {
        "payload": payload_motion(loaded, 21, periods, 2),
        "other": payload_motion(loaded, 22, 2, 2),
    }
    for name, motion in motions.items():
        (folder / f"{name}.yaml").write_text(to_yaml(motion))
    work.excitation("robot", 1, 3 if quick else 8)
    work.record("robot", "robot")
    estimate = work("identify", "robot", "-o", work.path("robot.json"), codes=(0, 6))["estimate"]
    experiments = (
        dict.fromkeys(("medium", "small", "large"), 1)
        if quick
        else {"medium": 3, "small": 2, "large": 2}
    )
    found: Tree = {
        "periods": periods,
        "friction": friction_of(estimate["parameters"]),
        "experiments": [],
    }
    for seed in range(max(experiments.values())):
        work.record("payload", f"empty {seed}", "--seed", str(seed))
    for name, count in experiments.items():
        body = loaded.plant.payloads[name]
        truth = np.array([body.mass_kg, *body.centre_m, *body.inertia_kg_m2])
        for seed in range(count):
            run = f"{name} {seed}"
            more = ("--seed", str(seed + 100), "--mounted", name)
            work.record("payload", run, *more)
            for procedure, options in (
                ("difference", ("--unloaded", f"empty {seed}", "--procedure", "difference")),
                ("model", ("--model", work.path("robot.json"))),
            ):
                file = work.path(f"{name}-{seed}-{procedure}.json")
                words = ("payload", "identify", "--loaded", run, *options, *ACCURATE, "-o", file)
                values = work(*words, codes=(0, 1, 6))["payload"]["parameters"]
                entry = payload_entry(values, truth)
                found["experiments"].append({"payload": name, "procedure": procedure} | entry)
    work.record("other", "other", "--mounted", "medium")
    words = ("validate", work.path("robot.json"), "other", "--limits", "50", "--payload")
    for procedure in ("difference", "model"):
        file = work.path(f"medium-0-{procedure}.json")
        axes = work(*words, file, codes=(0, 1))["validation"]["axes"][2:]
        found[f"other_{procedure}"] = {
            "error_nm": numbers([axis["rms_error"] for axis in axes]),
            "torque_nm": numbers([axis["rms_torque"] for axis in axes]),
        }
        if procedure == "difference":
            found["other_curves"] = torque_curves(run_result(folder, "other"), first_axis=2)
    return found


def payload_entry(values: list[Tree], truth: Any) -> Tree:
    """Return a payload's estimate, its errors and standard deviations."""
    found = np.array([each["value"] for each in values])
    return {
        "values": numbers(found),
        "errors": numbers(found - truth),
        "std": numbers([each["std"] for each in values]),
    }


def friction_of(parameters: list[Tree]) -> Tree:
    """Return the identified Coulomb and viscous friction of all axes, as in table 5.1."""
    named = {each["name"]: each["value"] for each in parameters}
    return {
        key: numbers([named[f"{prefix}_axis{j}"] for j in range(1, 7)])
        for key, prefix in (("coulomb_nm", "fc"), ("viscous_nm_s", "fv"))
    }


def sensitivity_results(folder: Path) -> Tree:
    """Return the table of wrong assumptions about the robot (table 5.3, figure 5.4)."""
    work = Workplace(folder, "kr15")
    document = work("sensitivity", "kr15", runs=False)
    return {
        row["case"]: {
            "percent": numbers(row["percent"]),
            "torque_percent": numbers([each for each in row["torque_percent"] if each is not None]),
        }
        for row in document["rows"]
    }


def wrong_prediction_results() -> Tree:
    """Return the torque of another motion predicted with wrong assumptions (figure 5.4).

    The torque constants of axes 3 to 6 and the links' parameters are wrong, as in the thesis.
    """
    loaded = load_cell("kr15")
    plant, robot = loaded.plant, loaded.robot
    assert plant is not None
    body = plant.payloads["medium"]
    wrist = range(2, len(robot.joints))
    problem = SensitivityProblem(
        robot,
        true_parameters(RobotModel.from_description(robot), robot, plant),
        PayloadBody.of_reported(np.array([body.mass_kg, *body.centre_m, *body.inertia_kg_m2])),
        thesis_motion(robot, wrist),
        np.array([axis.torque_noise_nm for axis in plant.axes]),
    )
    wrong = 1.0 + SHARE
    assumed = Assumptions(gains=(1.0, 1.0, *(wrong,) * len(wrist)), links=wrong)
    other = thesis_motion(robot, wrist, OTHER_PHASES)
    error, torque = prediction_error(problem, assumed, "model", other)
    moving = slice(wrist.start, None)
    return {
        "percent": numbers(100.0 * (root_mean_square(error) / root_mean_square(torque))[moving]),
        "noise_nm": numbers(problem.noise_nm[moving]),
        "error_nm": numbers(root_mean_square(error)[moving]),
        "time_s": curve(np.arange(len(torque)) * PERIOD_S / len(torque)),
        "measured": [curve(each) for each in torque.T[moving]],
        "predicted": [curve(each) for each in (torque - error).T[moving]],
    }
