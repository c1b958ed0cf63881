"""Series of section 5.6.3: friction and payload while the six-axis robot warms up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.runs.catalogue import find_run
from benchmarks.thesis.payload_experiment import cell_at, payload_motion
from benchmarks.thesis.records import Tree, numbers
from config.arrays import FloatArray
from config.load import load_cell, to_yaml
from identification.choices import BAND_HZ, STANDSTILL_RAD_S
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.estimate import Estimate
from identification.payload.body import reported
from identification.payload.procedures import PayloadOptions, equations_of
from identification.payload.smoothed_runs import SmoothedRuns
from identification.payload.solution import solve_payload
from rid_daq.runs.run_data import RunData
from tests.builders.known_model import known_estimate

COLD_K: Final = 298.15
PERIOD_S: Final = 6.0
HIGH: Final = 4
"""Higher harmonic; its frequency is that of harmonic 20 of the thesis's period of 30 s."""

FIRST_AXIS: Final = 2
"""First axis that moves, from 0."""

PAYLOAD: Final = "large"


def warming_results(folder: Path, quick: bool) -> Tree:
    """Return friction and payload of each measurement, one after the other from cold motors.

    A measurement is one period of a motion. The model of the robot without friction is exact, so
    that changes of the estimates are caused by the warming only. The payload is estimated twice:
    with the torque constants of cold motors, as in the thesis, and with torque constants that are
    corrected by the measured temperatures.
    """
    loaded = load_cell("kr15")
    assert loaded.plant is not None
    count = 4 if quick else 20
    motion = payload_motion(loaded, 23, count, FIRST_AXIS, period_s=PERIOD_S, high=HIGH)
    (folder / "series.yaml").write_text(to_yaml(motion))
    work = cell_at(folder, "cold", COLD_K)
    work.record("series", "series", "--mounted", PAYLOAD)
    recording = RunData.load(find_run(folder / "runs", "series")).recording
    true = known_estimate(loaded, {})
    exact = np.diag(np.square(1e-6 * np.abs(true.values) + 1e-9))
    robot = replace(true, covariance_residual=exact, covariance_jackknife=exact)
    body = loaded.plant.payloads[PAYLOAD]
    found: Tree = {
        "payload": PAYLOAD,
        "true": numbers([body.mass_kg, *body.centre_m, *body.inertia_kg_m2]),
    }
    for name, each in (("cold", with_cold_constants(recording, robot)), ("corrected", recording)):
        series = [measurement(period, robot) for period in single_periods(each)]
        friction, payload = (np.array([one[i] for one in series]) for i in (0, 1))
        found[name] = {
            "coulomb_nm": numbers(friction[:, 0].T),
            "viscous_nm_s": numbers(friction[:, 1].T),
            "values": numbers(payload.T),
        }
    return found


def with_cold_constants(recording: Recording, robot: Estimate) -> Recording:
    """Return a recording whose torques were computed with the torque constants of cold motors."""
    assert recording.temperature_k is not None
    joints = robot.robot.joints
    per_k = np.array([joint.torque_constant_per_k for joint in joints])
    reference_k = np.array([joint.reference_temperature_k for joint in joints])
    factor = 1.0 + per_k * (recording.temperature_k - reference_k)
    return replace(recording, torque_nm=recording.torque_nm / factor)


def single_periods(recording: Recording) -> list[Recording]:
    """Return the measured periods of a periodic motion, each with the rows around it."""
    rows = recording.samples_per_period
    assert rows is not None
    assert recording.sample_period_s is not None
    margin = round(2.5 / BAND_HZ / recording.sample_period_s)  # the low-pass needs it at both ends
    main = np.flatnonzero(recording.phase == Phase.MAIN)
    count = len(main) // rows
    starts = main[-1] + 1 - rows * np.arange(count, 0, -1)
    return [
        recording.part(slice(start - margin, start + rows + margin)) for start in starts.tolist()
    ]


def measurement(recording: Recording, robot: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return Coulomb and viscous friction of the moving axes, (2, axes), and the payload, (10,).

    Friction and payload are estimated together, as in the thesis.
    """
    signals = smoothed_recording(recording, BAND_HZ)
    runs = SmoothedRuns((signals,), (True,), STANDSTILL_RAD_S)
    equations = equations_of(robot.robot, runs, PayloadOptions("model", robot=robot))
    unknowns = solve_payload(equations, intervals=False).unknowns
    value = dict(zip(equations.names, unknowns.tolist(), strict=True))
    joints = robot.robot.joint_names[FIRST_AXIS:]
    friction = [[value[f"{kind}_{joint} in run 1"] for joint in joints] for kind in ("fc", "fv")]
    return np.array(friction), reported(unknowns[:10])
