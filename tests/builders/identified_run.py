"""Computed runs of the bundled arm, for tests that identify the arm or its friction."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.motion.kinds.fourier import FourierJoint
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import LoadedCell, load_cell, to_yaml
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.estimation.fitted_periods import fit_periodic

CYCLE_S = 0.008
PERIODS = 4
THERE_AND_BACK = ReversedMotion(
    kind="reversed",
    robot="ir361",
    period_s=6.0,
    periods=2,
    ramp_s=2.0,
    joints=(
        FourierJoint(joint="axis1", sine=(0.7, 0.1), cosine=(0.0, 0.2)),
        FourierJoint(joint="axis2", offset=-0.2, sine=(0.3, 0.2), cosine=(0.4, 0.0)),
        FourierJoint(joint="axis3", offset=0.5, sine=(-0.4, 0.3), cosine=(0.6, 0.1)),
    ),
)


@dataclass(frozen=True)
class ArmInMotion:
    """One period of an excitation of the bundled arm.

    Attributes:
        cell: Cell of the arm.
        q, v, a: Shape (samples, joints). Position [rad], velocity [rad/s] and acceleration
            [rad/s2].
    """

    cell: LoadedCell
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]


def arm_in_motion() -> ArmInMotion:
    """Return one period of a designed excitation."""
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
    """Write a run with noisy torques from true parameters, and its estimate.

    Args:
        root: Folder of all runs.
        arm: The recorded motion.
        label: Label of the run.
        seed: Seed of the noise.
        **changes: Factors by which single true parameters are multiplied, by name.
    """
    cell = arm.cell
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    parameters = np.array(true_parameters(model, cell.robot, cell.plant))
    for name, factor in changes.items():
        parameters[model.parameter_names.index(name)] *= factor
    count = PERIODS * len(arm.q)
    rows = np.zeros(count, dtype=row_dtype(3))
    rows["position"] = np.tile(arm.q, (PERIODS, 1))
    rows["torque_nm"] = np.tile(torque(model, arm.q, arm.v, arm.a, parameters), (PERIODS, 1))
    rows["phase"] = Phase.MAIN
    folder = RunFolder.create(root, label)
    recording = _journalled(folder, cell, rows, seed, len(arm.q))
    estimate = fit_periodic(cell.robot, [average_periods(recording)]).estimate(
        run_ids=(folder.run_id,)
    )
    write_estimate(folder.path / "model.json", estimate)
    folder.finish(RunStatus.COMPLETE)
    return estimate


def friction_run(root: Path, label: str, seed: int) -> RunFolder:
    """Write a run of a path in both directions, with noisy torques from true parameters.

    Args:
        root: Folder of all runs.
        label: Label of the run.
        seed: Seed of the noise.
    """
    cell = load_cell("ir361")
    samples = THERE_AND_BACK.plan(cell.robot, CYCLE_S)
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    parameters = np.array(true_parameters(model, cell.robot, cell.plant))
    q, v, a = samples.position, samples.velocity, samples.acceleration
    rows = np.zeros(len(q), dtype=row_dtype(3))
    rows["position"] = q
    rows["torque_nm"] = torque(model, q, v, a, parameters)
    rows["phase"] = samples.phase
    folder = RunFolder.create(root, label)
    folder.write("motion.yaml", to_yaml(THERE_AND_BACK).encode())
    _journalled(folder, cell, rows, seed, None)
    folder.finish(RunStatus.COMPLETE)
    return folder


def _journalled(
    folder: RunFolder, cell: LoadedCell, rows: NDArray[np.void], seed: int, period: int | None
) -> Recording:
    """Write a cell's files and its recording, and return the recording.

    The torques get noise with a standard deviation of 1 N m.
    """
    rows["time_s"] = np.arange(len(rows)) * CYCLE_S
    rows["cycle"] = rows["sample_index"] = np.arange(len(rows))
    rows["torque_nm"] += np.random.default_rng(seed).standard_normal((len(rows), 3))
    rows["valid"] = 1
    for name, content in cell.files.items():
        folder.write(name, content)
    header = JournalHeader(
        joint_names=cell.robot.joint_names,
        sample_period_s=CYCLE_S,
        samples_per_period=period,
        run_id=folder.run_id,
    )
    with JournalWriter(folder.file("recording.mcap"), header) as writer:
        writer.append(rows.tobytes())
    return read_journal(folder.file("recording.mcap")).recording()
