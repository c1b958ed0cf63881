"""`calibrate_robot`: calibrate a robot from its files, and write the corrected robot file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.runs.catalogue import find_runs
from acquisition.tracker.pose_file import MeasuredPoses, read_measured_poses
from acquisition.tracker.rests import find_rests
from config.arrays import BoolArray, FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_new
from config.load import load_robot, to_yaml
from config.robot.robot import RobotDescription
from identification.kinematics.calibration import (
    CONTRADICTS,
    PRECISE,
    SUSPICIOUS,
    Calibration,
    calibrate,
)
from identification.kinematics.corrected import changed_keys, corrected_robot
from identification.kinematics.held_out import HeldOut
from rid_daq.operations.calibration.calibrate_kinematics import CalibrateKinematicsRequest
from rid_daq.operations.calibration.gravity_source import read_gravity, stated_point
from rid_daq.operations.cell_files import refuse_other_robot
from rid_daq.runs.output_file import require_writable
from rid_daq.runs.run_data import RunData

GROSS_EXCESS: Final = 1.5
"""Ratio of errors to their prediction above which a note warns of effects that the model lacks."""


@dataclass(frozen=True)
class GearStiffness:
    """Identified stiffness of a gear.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the stiffness.
        stiffness, std: Value and standard deviation.
        deflection: Largest deflection in the poses [rad or m].
    """

    joint: str
    unit: str
    stiffness: float
    std: float
    deflection: float

    @property
    def is_precise(self) -> bool:
        """True if the standard deviation is at most 20 % of the value."""
        return self.std <= PRECISE * self.stiffness


@dataclass(frozen=True)
class CalibratedRobot:
    """A calibration, and the robot file that was written.

    Attributes:
        calibration: The calibration.
        changes: Keys that differ in the corrected robot file, with old and new value; empty if none
            was written.
        notes: Assumptions and warnings, one sentence each.
    """

    calibration: Calibration
    changes: tuple[tuple[str, str, str], ...]
    notes: list[str]

    @property
    def largest_rank(self) -> int:
        """Number of geometric parameters that one point shows at most."""
        sliding = self.calibration.fit.arm.chain.prismatic
        return int(4 * (~sliding).sum() + 2 * sliding.sum() + 3)

    @property
    def residual_rms_m(self) -> float:
        """RMS of the fit's residuals per coordinate."""
        return float(np.sqrt(np.mean(self.calibration.fit.residual_m**2)))

    @property
    def errors(self) -> tuple[tuple[str, HeldOut], ...]:
        """Held-out errors before, with calibrated geometry alone, and after the calibration."""
        found = self.calibration
        rigid = () if found.rigid is None else (("geometry", found.rigid),)
        return (("before", found.before), *rigid, ("after", found.after))

    @property
    def suspicious_rows(self) -> list[int]:
        """Lines of poses of the fit with a conspicuous error."""
        rows = self.calibration.poses.rows[self.calibration.suspicious]
        return [int(row) for row in rows]

    @property
    def contradiction(self) -> str:
        """How held-out errors contradict the calibration; empty if they do not."""
        found = [
            f"the error at {poses.name}:{poses.rows[i]} ({1e3 * errors.distance_m[i]:.3g} mm) is"
            f" {errors.ratio[i]:.3g} times as large as the median, each relative to its prediction"
            for poses, errors in self.calibration.judged
            for i in (errors.ratio > CONTRADICTS).nonzero()[0]
        ]
        if not found and self.calibration.is_contradicted:
            found.append(
                f"all errors are {self.calibration.after.excess:.3g} times those that the fit"
                " predicts: the instrument may have been moved, or the robot may have changed"
            )
        return "; ".join(found)

    @property
    def gears(self) -> tuple[GearStiffness, ...]:
        """Identified stiffnesses."""
        found = self.calibration
        arm, poses = found.fit.arm, found.poses
        if arm.gravity is None:
            return ()
        _, torque = arm.gravity.link_positions(poses.position, poses.load_kg, arm.compliance)
        deflection = np.abs(torque * arm.compliance).max(axis=0)
        return tuple(
            GearStiffness(
                found.robot.joint_names[each.joint],
                "N/m" if arm.chain.prismatic[each.joint] else "N m/rad",
                float(1.0 / arm.compliance[each.joint]),
                float(sigma / arm.compliance[each.joint] ** 2),
                float(deflection[each.joint]),
            )
            for each, sigma in zip(found.fit.parameters, found.sigmas, strict=True)
            if each.kind == "compliance"
        )


def calibrate_robot(request: CalibrateKinematicsRequest) -> CalibratedRobot:
    """Calibrate a robot; if held-out errors confirm it, write the requested robot file.

    Raises:
        ConfigError: A file cannot be read, does not fit the robot, or the output exists already, or
            the table of the check has rows of the fit.
        DataQualityError: The poses do not determine the parameters.
        EstimationError: The fit fails, or the payload failed its verdict.
        RecordingError, LockedError: A run cannot be read, or the output cannot be written.
    """
    if request.output is not None:
        if request.output.exists():
            raise ConfigError(
                f"{request.output}: the file exists already, and a robot file is never replaced:"
                " give another name",
                code="RID-OUTPUT-EXISTS",
            )
        require_writable(request.output)
    robot = load_robot(request.robot)
    read = read_measured_poses(request.poses, robot, _rests(request, robot))
    poses = read.keep(_first_copies(read))
    check = None
    if request.check is not None:
        check = read_measured_poses(request.check, robot)
        _refuse_shared_rows(poses, check)
    point = stated_point(robot, request.point)
    gravity, notes = read_gravity(request, robot, point)
    notes += _left_out_notes(poses, check)
    if len(poses) < len(read):
        notes.append(
            f"{poses.name}: {len(read) - len(poses)} rows are left out, because they are copies of"
            " other rows"
        )
    found = calibrate(robot, poses, gravity, point, check)
    notes += _quality_notes(found)
    changes: tuple[tuple[str, str, str], ...] = ()
    if request.output is not None and found.holds:
        corrected = corrected_robot(found, is_tool=request.point is None)
        comment = (
            f"Calibrated by `rid-daq calibrate kinematics` from {len(poses)} poses in"
            f" {request.poses.name}.\nError at held-out poses: mean"
            f" {1e3 * found.after.mean_m:.3f} mm, largest {1e3 * found.after.max_m:.3f} mm."
        )
        write_new(request.output, to_yaml(corrected, comment).encode())
        changes = changed_keys(robot, corrected)
        notes += _unwritten_notes(found)
    elif request.output is not None:
        notes.append("no robot file is written, because the calibration is not confirmed")
    return CalibratedRobot(found, changes, notes)


def _first_copies(poses: MeasuredPoses) -> BoolArray:
    """Return True for each row, (poses,), except the second and later of equal rows."""
    values = np.column_stack([poses.position, poses.point_m, poses.load_kg])
    first = np.zeros(len(poses), np.bool_)
    first[np.unique(values, axis=0, return_index=True)[1]] = True
    return first


def _refuse_shared_rows(poses: MeasuredPoses, check: MeasuredPoses) -> None:
    """Refuse a check whose rows are rows of the fit.

    Raises:
        ConfigError: A row has the same joint positions and the same point in both tables.
    """
    of_fit, of_check = (np.hstack([each.position, each.point_m]) for each in (poses, check))
    same = (of_check[:, np.newaxis] == of_fit).all(axis=2)
    if same.any():
        row, fitted = np.argwhere(same)[0]
        raise ConfigError(
            f"--check {check.name}:{check.rows[row]}: is line {poses.rows[fitted]} of"
            f" {poses.name}, which the fit uses ({same.any(axis=1).sum()} such rows): give poses"
            " that are not in the table of the fit, or leave --check out",
            code="RID-OPTION-NO-EFFECT",
        )


def _unwritten_notes(found: Calibration) -> list[str]:
    """Return a note on identified stiffnesses that are not in the robot file."""
    weak = [found.robot.joint_names[joint] for joint in found.imprecise]
    if not weak:
        return []
    return [
        f"stiffness_nm_rad of {', '.join(weak)} is not written, because its standard deviation is"
        f" more than {100.0 * PRECISE:.0f} % of the value"
    ]


def _rests(request: CalibrateKinematicsRequest, robot: RobotDescription) -> FloatArray | None:
    """Return the joint positions at all rests of the named runs, (rests, n); None without runs.

    Raises:
        ConfigError: A run is of another robot.
        DataQualityError: A run has no rest.
        RecordingError, LockedError: A run cannot be read, or is still being recorded.
    """
    if not request.run:
        return None
    poses = []
    for folder in find_runs(request.runs, request.run):
        data = RunData.load(folder)
        refuse_other_robot(Path(folder.run_id), data.robot, robot)
        poses.append(find_rests(data.recording).position)
    return np.concatenate(poses)


def _left_out_notes(poses: MeasuredPoses, check: MeasuredPoses | None) -> list[str]:
    return [
        f"{each.name}: {each.left_out} rows are left out, because `valid` is 0"
        for each in (poses, check)
        if each is not None and each.left_out
    ]


def _quality_notes(found: Calibration) -> Iterator[str]:
    """Yield warnings about the poses and about effects that the model lacks."""
    poses, scale = found.poses, found.fit.scale
    if poses.sigma_m is not None and scale > GROSS_EXCESS:
        yield (
            f"the residuals are {scale:.2g} times the stated errors of the instrument: the arm has"
            " effects that the model lacks (backlash, bending links), or the stated errors are too"
            " small; the intervals are widened"
        )
    if found.after.excess > GROSS_EXCESS:
        yield (
            f"the errors at held-out poses are {found.after.excess:.2g} times those that the fit"
            " predicts; the intervals are widened"
        )
    for each, errors in found.judged:
        if (wrong := errors.ratio > SUSPICIOUS).any():
            rows = ", ".join(map(str, each.rows[wrong]))
            yield (
                f"{each.name}: the errors in line {rows} are conspicuous: measure these poses"
                " again, or mark them by 0 in a column `valid`"
            )
    if found.fit.arm.gravity is None and poses.load_kg.any():
        yield "the loads in the poses have no effect, because the gears count as rigid"
