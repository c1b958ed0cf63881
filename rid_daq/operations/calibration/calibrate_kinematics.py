"""`calibrate kinematics`: geometry and gear stiffness from measured positions of one point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Cells, Interval, Table, Text, Verdict, note_blocks, table
from rid_daq.blocks.formats import number
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayloadOfModel,
    Coordinate,
    DespiteMisfitOfModel,
    MeasuredPoint,
    Option,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.kinematics.held_out import HeldOut
    from rid_daq.operations.calibration.kinematic_calibration import CalibratedRobot

RobotName = Annotated[
    str,
    Field(description="Bundled robot or a robot file."),
    Option(positional=True, metavar="ROBOT", file="input"),
]
LoadCentre = Annotated[
    tuple[Coordinate, Coordinate, Coordinate] | None,
    Field(
        description="Centre of gravity of the loads in the frame of the last link; the measured"
        " point if not set."
    ),
    Option(metavar="X,Y,Z", unit="m", separator=","),
]
GravityModel = Annotated[
    Path | None,
    Field(
        description="Model file of `identify`, for the torques of gravity; the robot file's `cad`"
        " if not set."
    ),
    Option(metavar="MODEL", file="input"),
]


class CalibrateKinematicsRequest(Request):
    """Identify a robot's geometry and gear stiffness from measured positions of one point.

    An instrument, such as a laser tracker, measures one point on the last link in many poses at
    rest. The table of poses has a column for each joint (axis1 or axis1_rad, axis1_deg) and x_m,
    y_m, z_m (or x_mm, y_mm, z_mm); optional are sigma_m, load_kg and valid. The frame of the
    instrument is unknown. The result is judged by poses that the fit did not use. It fails if the
    calibration does not reduce their errors, or if an error contradicts it.

    In a terminal: exit code 1 if the result fails.
    """

    robot: RobotName
    poses: Annotated[
        Path,
        Field(description="Table of poses with measured points (CSV)."),
        Option(positional=True, metavar="POSES", file="input"),
    ]
    model: GravityModel = None
    despite_misfit: DespiteMisfitOfModel = False
    payload: CarriedPayloadOfModel = None
    point: MeasuredPoint = None
    load_centre: LoadCentre = None
    run: Annotated[
        tuple[str, ...],
        Field(
            description="Run that rested at the poses; the joint positions are those measured at"
            " its rests. The table then needs no joint columns if its rows have the order of the"
            " rests."
        ),
        Option(metavar="RUN"),
    ] = ()
    check: Annotated[
        Path | None,
        Field(
            description="Table of further poses that judge the result; if not set, each fifth of"
            " the poses is predicted from the others."
        ),
        Option(metavar="POSES", file="input"),
    ] = None
    output: Annotated[
        Path | None,
        Field(
            description="Corrected robot file to write if the held-out errors confirm the"
            " calibration; an existing file is never replaced."
        ),
        Option(short="o", metavar="ROBOT", group=FILES, file="output", endings=(".yaml",)),
    ] = None
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class CalibrateKinematicsResult:
    """A kinematic calibration.

    Attributes:
        request: The request.
        found: The calibration, the corrected robot and notes.
    """

    request: CalibrateKinematicsRequest
    found: CalibratedRobot

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the errors at held-out poses do not confirm the calibration."""
        from rid_daq.terminal.exit_codes import ExitCode

        holds = self.found.calibration.holds
        return ExitCode.DONE if holds else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return parameters, errors and changed keys as numbers, in SI units."""
        calibration = self.found.calibration
        fit, sigmas = calibration.fit, calibration.sigmas
        return {
            "robot": calibration.robot.name,
            "poses": len(calibration.poses),
            "improves": calibration.improves,
            "holds": calibration.holds,
            "rank": calibration.rank,
            "largest_rank": self.found.largest_rank,
            "condition": calibration.condition,
            "parameters": [
                {
                    "name": each.name,
                    "unit": each.unit,
                    "value": float(value),
                    "change": None if each.kind == "frame" else float(change),
                    "std": float(sigma),
                }
                for each, value, change, sigma in zip(
                    fit.parameters, calibration.values, calibration.changes, sigmas, strict=True
                )
            ],
            "held": [each.name for each in calibration.fixed],
            "stiffness": [
                {
                    "joint": each.joint,
                    "stiffness": each.stiffness,
                    "std": each.std,
                    "is_precise": each.is_precise,
                }
                for each in self.found.gears
            ],
            "stiffness_not_shown": list(calibration.hidden),
            "residual_rms_m": self.found.residual_rms_m,
            "error_excess": calibration.after.excess,
            "errors": {
                name: {"mean_m": each.mean_m, "rms_m": each.rms_m, "max_m": each.max_m}
                for name, each in self.found.errors
            },
            "suspicious_rows": self.found.suspicious_rows,
            "output": None if self.request.output is None else str(self.request.output),
            "changes": [
                {"key": key, "before": before, "after": after}
                for key, before, after in self.found.changes
            ],
            "notes": self.found.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, parameters, stiffness, errors, changed keys and the verdict."""
        found, calibration = self.found, self.found.calibration
        yield from note_blocks(found.notes)
        yield Text(
            text=f"Identifiable geometric parameters: {calibration.rank} of at most"
            f" {found.largest_rank} (4 R + 2 P + 3 for R revolute and P prismatic joints)."
            f" Condition number of the fit: {number(calibration.condition, 3)}."
        )
        yield Text(
            text="Held, because others have the same effect on the point, or because they have"
            f" none: {', '.join(each.name for each in calibration.fixed)}."
        )
        yield self._parameter_table()
        if found.gears:
            yield Text(text="Stiffness of the gears, from their deflection under gravity:")
            yield self._gear_table()
        if calibration.hidden and calibration.fit.arm.gravity is not None:
            yield Text(
                text="Stiffness not shown by these poses: " + ", ".join(calibration.hidden) + "."
            )
        yield Text(text=f"Residual of the fit: {_mm(found.residual_rms_m)} mm RMS per coordinate.")
        yield self._error_table()
        if found.changes:
            yield Text(text=f"Changes in {self.request.output}:")
            yield table(
                found.changes,
                Cells("key", lambda each: each[0]),
                Cells("before", lambda each: each[1] or "–"),
                Cells("after", lambda each: each[2] or "–"),
            )
            yield Text(
                text="Models of the old robot file do not fit the new one: identify the model"
                " again with it."
            )
        yield self._verdict()

    def _verdict(self) -> Verdict:
        calibration = self.found.calibration
        before, after = calibration.before, calibration.after
        why = self.found.contradiction
        return Verdict(
            passed=calibration.holds,
            text=f"Error at poses that the fit did not use: mean {_mm(after.mean_m)} mm, largest"
            f" {_mm(after.max_m)} mm; before the calibration: mean {_mm(before.mean_m)} mm,"
            f" largest {_mm(before.max_m)} mm. The error of the instrument is included."
            + (f" The calibration is contradicted: {why}." if why else ""),
        )

    def _parameter_table(self) -> Table:
        calibration = self.found.calibration
        parameters = calibration.fit.parameters
        values, changes, sigmas = calibration.values, calibration.changes, calibration.sigmas
        rows = [i for i, each in enumerate(parameters) if each.kind != "compliance"]
        return table(
            rows,
            Cells("parameter", lambda i: parameters[i].name),
            Cells("unit", lambda i: f"m{parameters[i].unit}"),
            Cells("nominal", lambda i: self._nominal(i, values[i] - changes[i])),
            Cells("calibrated", lambda i: f"{1e3 * values[i]:.3f}"),
            Cells("change", lambda i: self._change(i, changes[i], sigmas[i])),
        )

    def _nominal(self, i: int, value: float) -> str:
        is_frame = self.found.calibration.fit.parameters[i].kind == "frame"
        return "–" if is_frame else f"{1e3 * value:.3f}"

    def _change(self, i: int, change: float, sigma: float) -> Interval | str:
        if self.found.calibration.fit.parameters[i].kind == "frame":
            return f"± {2e3 * sigma:.2g}"
        return Interval.of(change, sigma, 1e3)

    def _gear_table(self) -> Table:
        return table(
            self.found.gears,
            Cells("joint", lambda each: each.joint),
            Cells("stiffness", lambda each: Interval.of(each.stiffness, each.std)),
            Cells("unit", lambda each: each.unit),
            Cells("largest deflection", lambda each: 1e3 * each.deflection, "mrad or mm", 3),
            Cells("", lambda each: "" if each.is_precise else "not precise"),
        )

    def _error_table(self) -> Table:
        rows: tuple[tuple[str, HeldOut], ...] = self.found.errors
        words = {
            "before": "nominal geometry",
            "geometry": "calibrated, rigid gears",
            "after": "calibrated",
        }
        return table(
            rows,
            Cells("error at held-out poses", lambda row: words[row[0]]),
            Cells("mean", lambda row: 1e3 * row[1].mean_m, "mm", 3),
            Cells("RMS", lambda row: 1e3 * row[1].rms_m, "mm", 3),
            Cells("largest", lambda row: 1e3 * row[1].max_m, "mm", 3),
        )


def _mm(length_m: float) -> str:
    return number(1e3 * length_m, 3)


def run(request: CalibrateKinematicsRequest, _context: Context) -> CalibrateKinematicsResult:
    """Calibrate the robot, and write the corrected robot file if requested."""
    from rid_daq.operations.calibration.kinematic_calibration import calibrate_robot

    return CalibrateKinematicsResult(request, calibrate_robot(request))


OPERATION: Final = Operation(
    name="calibrate kinematics",
    label="Calibrate a robot's kinematics",
    request=CalibrateKinematicsRequest,
    run=run,
    examples=(
        "calibrate kinematics robot.yaml poses.csv --model model.json --output calibrated.yaml",
        "calibrate kinematics kr15 poses.csv --point 0.12,0.05,-0.10 --json",
        "calibrate kinematics robot.yaml poses.csv --run free --run loaded",
    ),
    module="rid_daq.operations.calibration.kinematic_calibration",
)
