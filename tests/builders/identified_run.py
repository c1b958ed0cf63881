"""Runs of the bundled arm with its estimate, computed instead of recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import LoadedCell, load_cell
from dynamics.model.robot_model import RobotModel, torque
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.estimators import estimate_periodic
from identification.estimation.file import write_estimate
from rid_daq.jobs.truth import true_parameters

CYCLE_S = 0.008
PERIODS = 4


@dataclass(frozen=True)
class ArmInMotion:
    """One period of an excitation of the bundled arm: times [s], position, velocity, acceleration.

    Attributes
    ----------
    cell : LoadedCell
        The arm's cell.
    q, v, a : array of (samples, joints)
        Position [rad], velocity [rad/s] and acceleration [rad/s2].
    """

    cell: LoadedCell
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]


def arm_in_motion() -> ArmInMotion:
    """Design the excitation."""
    cell = load_cell("ir361")
    motion = design_two_harmonic(
        cell.robot, TwoHarmonicOptions(5.0, highest_harmonic=6, tries=20, periods=PERIODS), CYCLE_S
    )
    path = motion.trajectory(cell.robot, CYCLE_S)
    times = path.sample_times_s
    return ArmInMotion(cell, path.position(times), path.velocity(times), path.acceleration(times))


def identified_run(
    root: Path, arm: ArmInMotion, label: str, seed: int, **changes: float
) -> Estimate:
    """Write a run of noisy torques by true parameters, with its estimate.

    Parameters
    ----------
    root : Path
        The folder of the run folders.
    arm : ArmInMotion
        What is recorded.
    label : str
        The run's label.
    seed : int
        Of the noise.
    **changes : float
        Factors of single parameters, by their names.
    """
    cell = arm.cell
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    parameters = np.array(true_parameters(model, cell.robot, cell.plant))
    for name, factor in changes.items():
        parameters[model.parameter_names.index(name)] *= factor
    count = PERIODS * len(arm.q)
    noise = np.random.default_rng(seed).standard_normal((count, 3))
    rows = np.zeros(count, dtype=row_dtype(3))
    rows["time_s"] = np.arange(count) * CYCLE_S
    rows["cycle"] = rows["sample_index"] = np.arange(count)
    rows["position"] = np.tile(arm.q, (PERIODS, 1))
    rows["torque_nm"] = np.tile(torque(model, arm.q, arm.v, arm.a, parameters), (PERIODS, 1))
    rows["torque_nm"] += noise
    rows["valid"], rows["phase"] = 1, Phase.MAIN
    folder = RunFolder.create(root, label)
    for name, content in cell.files.items():
        folder.write(name, content)
    header = JournalHeader(
        joint_names=cell.robot.joint_names,
        sample_period_s=CYCLE_S,
        samples_per_period=len(arm.q),
        run_id=folder.run_id,
    )
    with JournalWriter(folder.file("recording.mcap"), header) as writer:
        writer.append(rows.tobytes())
    recording = read_journal(folder.file("recording.mcap")).recording()
    estimate = estimate_periodic(cell.robot, [average_periods(recording)], run_ids=(folder.run_id,))
    write_estimate(folder.path / "model.json", estimate)
    folder.finish(RunStatus.COMPLETE)
    return estimate
