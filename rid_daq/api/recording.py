"""`Recording`: measured positions and torques of a robot, and `read_recording`."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from acquisition.maps.import_joint import ImportJoint
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import TimeColumn
from acquisition.maps.torque_meaning import MEANINGS, MOTOR_CURRENT, TorqueMeaning
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST, require_label
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.yaml_tree import dump_yaml
from config.load import load_bundled_or_path
from rid_daq.api.arguments import (
    as_numbers,
    as_path,
    refuse_far_positions,
    require,
    validated,
)
from rid_daq.api.curves import curves_plot
from rid_daq.api.proposed_map import ProposedMap
from rid_daq.api.robot import Robot, as_robot
from rid_daq.api.temporary_files import changed_text
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.plot import Axis
from rid_daq.operations.experiment.import_ import ImportRequest
from rid_daq.operations.experiment.imported_runs import import_files
from rid_daq.runs.run_data import RunData, all_defects

MAP = "map.yaml"


class TemporaryFolder:
    """A folder that is deleted when no object refers to it any more, or when the program ends."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="rid-daq-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@dataclass(frozen=True, eq=False)
class Recording:
    """Positions and torques of a robot over time, read and checked.

    Attributes:
        run: The data as the operations use them.
        notes: Findings of the import: rows that were left out, clocks, units, an assumed
            meaning of the torques.
    """

    run: RunData
    notes: tuple[str, ...] = ()
    _files: TemporaryFolder | None = field(default=None, repr=False)

    @classmethod
    def from_arrays(
        cls,
        time_s: npt.ArrayLike,
        position: npt.ArrayLike,
        torque_nm: npt.ArrayLike,
        *,
        robot: Robot | str | Path,
        torques: TorqueMeaning | None = None,
        velocity: npt.ArrayLike | None = None,
        period_s: float | None = None,
        name: str = "arrays",
    ) -> Self:
        """Return a recording from arrays, after the checks of an import.

        Args:
            time_s: Shape (samples,). Time stamps [s]; they need not be uniform.
            position: Shape (samples, joints). Measured positions, link side [rad or m].
            torque_nm: Shape (samples, joints). Torques of the actuators, link side [N m or N].
            robot: The robot that moved, its bundled name, or the path of a robot file.
            torques: Meaning of the torques: motor_torque, joint_torque (of sensors behind the
                gear), model_based or gravity_compensated. Left out, motor torques are assumed.
            velocity: Shape (samples, joints). Measured velocities [rad/s or m/s]. They are
                compared with the positions, so that a wrong unit or clock is found.
            period_s: Period [s], if the motion is periodic; the arrays then contain whole periods.
            name: Name of the recording in messages.

        Raises:
            ConfigError: An array has a wrong shape, or not real numbers; or positions are far
                beyond the limits, probably in degrees; or `torques` has another value; or the
                period is not positive (RID-API-ARGUMENT); or the name is invalid (RID-FILE-NAME).
            DataQualityError: Too many rows are damaged, the values are impossible for a robot, or
                the motion does not repeat after the period (RID-IMPORT-PERIOD).
        """
        robot = as_robot("robot", robot)
        n = len(robot.joint_names)
        require_label(require("name", name, str))
        if torques is not None:
            require("torques", torques, str)
        if torques == MOTOR_CURRENT or torques not in (None, *MEANINGS):
            others = ", ".join(each for each in MEANINGS if each != MOTOR_CURRENT)
            raise ConfigError(
                f"torques={torques!r}: the arrays have torques [N m or N]: use one of {others}",
                code="RID-API-ARGUMENT",
            )
        given = {"position": position, "torque_nm": torque_nm}
        if velocity is not None:
            given["velocity"] = velocity
        columns = [as_numbers("time_s", time_s, finite=False)]
        for table in (as_numbers(key, each, finite=False) for key, each in given.items()):
            if columns[0].ndim != 1 or table.shape != (len(columns[0]), n):
                raise ConfigError(
                    f"{name}: arrays of shape {columns[0].shape} (time_s) and {table.shape}: give"
                    f" (samples,) and (samples, {n}), one column per joint of {robot.name}",
                    code="RID-API-ARGUMENT",
                )
            columns += list(table.T)
        joints = tuple(
            ImportJoint(
                joint=joint,
                position=1 + i,
                torque=1 + n + i,
                velocity=None if velocity is None else 1 + 2 * n + i,
            )
            for i, joint in enumerate(robot.joint_names)
        )
        own = {"name": "arrays", "robot": "robot.yaml", "columns": len(columns), "torques": torques}
        time = TimeColumn(column=0, unit="s")
        layout = validated(ImportMap, {**own, "time": time, "joints": joints, "period_s": period_s})
        measured = np.column_stack(columns[1 : 1 + n])
        refuse_far_positions(robot.description, measured, layout.left_out_limit)
        with tempfile.TemporaryDirectory(prefix="rid-daq-") as folder:
            file = Path(folder) / f"{name}.csv"
            np.savetxt(file, np.column_stack(columns), fmt="%.17g", delimiter=",")

            def change(text: str) -> str:
                return _with_array_names(text, name, list(given), n)

            with changed_text(change):
                recording = cls._import_files((file,), layout, robot, "")
            return replace(recording, notes=tuple(map(change, recording.notes)))

    @classmethod
    def _import_files(
        cls, files: tuple[Path, ...], layout: str | ImportMap, robot: Robot | None, rows: str
    ) -> Self:
        """Import files into a temporary run folder, which is deleted with the recording."""
        folder = TemporaryFolder()
        place = folder.path
        if robot is not None:
            if isinstance(layout, str):
                layout = load_bundled_or_path(layout, "maps", ImportMap)
            robot.save(place / "robot.yaml")
            layout = layout.model_copy(update={"robot": "robot.yaml"})
            keys = layout.model_dump(mode="json", exclude_unset=True)
            (place / MAP).write_text(dump_yaml(keys), encoding="utf-8")
            layout = str(place / MAP)
        request = ImportRequest.of(
            {
                "file": files,
                "map": layout,
                "rows": (rows,) if rows else (),
                "runs": place / "runs",
            },
            shown="read_recording",
        )
        (imported,) = import_files(request)
        return cls.from_run(imported.folder, folder)

    @classmethod
    def from_run(cls, folder: RunFolder, files: TemporaryFolder | None = None) -> Self:
        """Return the recording in a run folder.

        Args:
            folder: The run folder.
            files: Temporary folder that contains the run folder; it is deleted with the recording.

        Raises:
            RidDaqError: The run cannot be read, or has no usable recording.
        """
        run = RunData.load(folder)
        report = run.import_report
        notes = () if report is None else report.notes
        return cls(run, (*notes, *all_defects([run])), files)

    @property
    def robot(self) -> Robot:
        """The robot that moved."""
        return Robot(self.run.robot)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to flange."""
        return self.run.robot.joint_names

    @property
    def time_s(self) -> FloatArray:
        """Shape (samples,). Times [s]; those of the source, unless the import corrected them."""
        return self.run.recording.time_s

    @property
    def position(self) -> FloatArray:
        """Shape (samples, joints). Positions, link side [rad or m]."""
        return self.run.recording.position

    @property
    def torque_nm(self) -> FloatArray:
        """Shape (samples, joints). Torques of the actuators, link side [N m or N]."""
        return self.run.recording.torque_nm

    @property
    def is_periodic(self) -> bool:
        """True if the recording has whole periods, which are averaged."""
        return self.run.is_periodic

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield positions and torques over time."""
        position, torque = Axis("position", "rad or m"), Axis("torque", "N m or N")
        parts = ((position, self.position), (torque, self.torque_nm))
        yield curves_plot(self.joint_names, Axis("time", "s"), self.time_s - self.time_s[0], parts)

    def with_robot(self, robot: Robot | str | Path) -> Self:
        """Return the recording with another description of the same robot.

        Raises:
            ConfigError: The joints have other names (RID-ROBOT-OTHER).
        """
        robot = as_robot("robot", robot)
        if robot.joint_names != self.joint_names:
            raise ConfigError(
                f"robot {robot.name} has the joints {', '.join(robot.joint_names)}, the recording"
                f" {', '.join(self.joint_names)}: use the same names",
                code="RID-ROBOT-OTHER",
            )
        return replace(self, run=replace(self.run, robot=robot.description))

    def __len__(self) -> int:
        return len(self.time_s)

    def __str__(self) -> str:
        span_s = self.time_s[-1] - self.time_s[0]
        head = f"{self.run.folder.manifest().label}: {len(self)} samples in {span_s:.1f} s"
        return "\n".join((f"{head}, robot {self.run.robot.name}", *self.notes))

    def __repr__(self) -> str:
        return str(self)


def _with_array_names(text: str, name: str, arrays: Sequence[str], joints: int) -> str:
    """Name arrays in a text, not the file and the map with which they are read."""

    def name_array(found: re.Match[str]) -> str:
        array, joint = divmod(int(found[1]) - 1, joints)
        return "time_s" if array < 0 else f"{arrays[array]}[:, {joint}]"

    text = text.replace(f"{name}.csv", f"recording {name}").replace(" with map 'arrays'", "")
    text = text.replace("Correct the columns or units in the map", "Correct the units")
    text = text.replace("wrong map or damaged file: ", "")
    text = re.sub(
        r"put `[^`]+` (?:under `\w+` into|into `\w+` of|into) the map", "convert it", text
    )
    text = re.sub(r",? in (?:the|its) map\b", "", text)
    text = re.sub(r"\bcolumn (\d+)", name_array, text)
    return text.replace("columns", "arrays")


@contextmanager
def named_recordings(recordings: Sequence[Recording]) -> Iterator[None]:
    """Name recordings in the text of an error by their labels, not by temporary folders and ids.

    Raises:
        RidDaqError: The error of the `with` block, with the new text.
    """

    def change(text: str) -> str:
        for each in recordings:
            if each._files is not None:
                folder, label = each.run.folder, each.run.folder.manifest().label
                text = text.replace(str(folder.path), f"recording {label}")
                text = text.replace(f"run {folder.run_id}", f"recording {label}")
                text = text.replace(folder.run_id, str(label))
        return text

    with changed_text(change):
        yield


def read_recording(
    source: str | Path,
    *further: str | Path,
    map: str | Path | ProposedMap = "",  # as the option --map; the builtin is not used here
    rows: str = "",
    robot: Robot | str | Path | None = None,
) -> Recording:
    """Read a recording: CSV, MAT, NPZ, HDF5 or Parquet files, a ROS bag, or a run folder.

    Files are checked as by `rid-daq import`: damaged rows are left out, time stamps are corrected
    if recorded velocities show that they are wrong, and units and signs are tested.
    `Recording.notes` lists the findings. A run folder is read as it was recorded or imported. The
    source is not changed.

    Args:
        source: A file, or a run folder.
        further: Further files of the same motion, if the map has `further_files`.
        map: Meaning of the columns, arrays or messages: a bundled name (ur10e_31, ur10e_19,
            ur10_ros), the path of an import map, or the result of `propose_map`, which you confirm
            in this way. A run folder needs none.
        rows: Rows to use, such as 355-5090, counted from 1; all if empty.
        robot: The robot; by default the one that the map names, or for which it was proposed.

    Raises:
        ConfigError: A file or the map cannot be read, or the map does not describe the file.
        DataQualityError: Too many rows are damaged, or the values are impossible for a robot.
        RecordingError: The run folder is damaged.
    """
    path = as_path("source", source)
    if not isinstance(rows, str):
        raise ConfigError(
            f"rows: {rows!r}: give the first and the last row as text, such as '355-5090'",
            code="RID-API-ARGUMENT",
        )
    robot = None if robot is None else as_robot("robot", robot)
    others = tuple(as_path(f"further[{i}]", each) for i, each in enumerate(further))
    if not isinstance(map, ProposedMap):
        map = str(as_path("map", map)) if map != "" else ""
    if (path / MANIFEST).is_file():
        if map or rows or others:
            raise ConfigError(
                f"{path}: a run folder is read as a whole: leave map, rows and further files out",
                code="RID-OPTION-NO-EFFECT",
            )
        found = Recording.from_run(RunFolder.open(path))
        return found if robot is None else found.with_robot(robot)
    if not map:
        raise ConfigError(
            f"{path}: is not a run folder: give `map`, which defines the columns;"
            f" propose_map({str(path)!r}, robot=...) proposes one",
            code="RID-OPTION-NEEDS",
        )
    if isinstance(map, ProposedMap):
        layout: str | ImportMap = map.to_import_map()
        robot = robot or map.robot
    else:
        layout = map
    return Recording._import_files((path, *others), layout, robot, rows)
