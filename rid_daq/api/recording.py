"""`Recording`: measured positions and torques of a robot, and `read_recording`."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from acquisition.imports.import_joint import ImportJoint
from acquisition.imports.import_map import ImportMap
from acquisition.imports.time_column import TimeColumn
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import load_bundled_or_path, to_yaml
from rid_daq.api.curves import curves_plot
from rid_daq.api.robot import Robot
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.plot import Axis
from rid_daq.operations.experiment.import_ import ImportRequest
from rid_daq.operations.experiment.imported_runs import import_files
from rid_daq.runs.run_data import RunData, all_defects

MAP = "map.yaml"


class TemporaryFolder:
    """A folder that is deleted with the last object that refers to it, or when the program ends."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="rid-daq-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@dataclass(frozen=True, eq=False)
class Recording:
    """Positions and torques of a robot over time, read and checked.

    Attributes:
        run: The data as the operations use them.
        notes: Findings of the import: rows that were left out, clocks, units.
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
        robot: Robot,
        velocity: npt.ArrayLike | None = None,
        period_s: float | None = None,
        name: str = "arrays",
    ) -> Self:
        """Return a recording from arrays, after the checks of an import.

        Args:
            time_s: Shape (samples,). Time stamps [s]; they need not be uniform.
            position: Shape (samples, joints). Measured positions, link side [rad or m].
            torque_nm: Shape (samples, joints). Torques of the actuators, link side [N m or N].
            robot: The robot that moved.
            velocity: Shape (samples, joints). Measured velocities [rad/s or m/s]. They are
                compared with the positions, so that a wrong unit or clock is found.
            period_s: Period [s], if the motion is periodic; the arrays then contain whole periods.
            name: Name of the recording in messages.

        Raises:
            ConfigError: An array has a wrong shape (RID-API-ARGUMENT).
            DataQualityError: Too many rows are damaged, or the values are impossible for a robot.
        """
        n = len(robot.joint_names)
        tables = [position, torque_nm] if velocity is None else [position, torque_nm, velocity]
        columns = [np.asarray(time_s, dtype=np.float64)]
        for table in (np.asarray(each, dtype=np.float64) for each in tables):
            if columns[0].ndim != 1 or table.shape != (len(columns[0]), n):
                raise ConfigError(
                    f"{name}: arrays of shape {columns[0].shape} (time_s) and {table.shape}: give"
                    f" (samples,) and (samples, {n}), one column per joint of {robot.name}",
                    code="RID-API-ARGUMENT",
                )
            columns += list(table.T)
        layout = ImportMap(
            name="arrays",
            robot="robot.yaml",
            columns=len(columns),
            time=TimeColumn(column=0, unit="s"),
            joints=tuple(
                ImportJoint(
                    joint=joint,
                    position=1 + i,
                    torque=1 + n + i,
                    velocity=None if velocity is None else 1 + 2 * n + i,
                )
                for i, joint in enumerate(robot.joint_names)
            ),
            period_s=period_s,
        )
        with tempfile.TemporaryDirectory(prefix="rid-daq-") as folder:
            file = Path(folder) / f"{name}.csv"
            np.savetxt(file, np.column_stack(columns), fmt="%.17g", delimiter=",")
            return cls._import_files((file,), layout, robot, "")

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
            (place / MAP).write_text(to_yaml(layout), encoding="utf-8")
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
        """Return the recording in a run folder; the recording later deletes the folder `files`."""
        run = RunData.load(folder)
        return cls(run, tuple(all_defects([run])), files)

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
        """Shape (samples,). Time stamps [s]; corrected if those of the source were wrong."""
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

    def with_robot(self, robot: Robot) -> Self:
        """Return the recording with another description of the same robot.

        Raises:
            ConfigError: The joints have other names (RID-ROBOT-OTHER).
        """
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


def read_recording(
    source: str | Path,
    *further: str | Path,
    map: str | Path = "",  # named as the option --map; this function does not use the builtin
    rows: str = "",
    robot: Robot | None = None,
) -> Recording:
    """Read a recording: CSV, MAT, NPZ, HDF5 or Parquet files, a ROS bag, or a run folder.

    Files are checked as by `rid-daq import`: damaged rows are left out, wrong time stamps are
    corrected, and units and signs are tested; `Recording.notes` lists the findings. A run folder is
    read as it was recorded or imported. The source is not changed.

    Args:
        source: A file, or a run folder.
        further: Further files of the same motion, if the map has `further_files`.
        map: Meaning of the columns, arrays or messages: a bundled name (ur10e_31, ur10e_19,
            ur10_ros) or the path of an import map. A run folder needs none.
        rows: Rows to use, such as 355-5090, counted from 1; all if empty.
        robot: The robot; by default the one that the map names.

    Raises:
        ConfigError: A file or the map cannot be read, or the map does not describe the file.
        DataQualityError: Too many rows are damaged, or the values are impossible for a robot.
        RecordingError: The run folder is damaged.
    """
    path = Path(source)
    if (path / MANIFEST).is_file():
        if map or rows or further:
            raise ConfigError(
                f"{path}: a run folder is read as a whole: leave map, rows and further files out",
                code="RID-OPTION-NO-EFFECT",
            )
        found = Recording.from_run(RunFolder.open(path))
        return found if robot is None else found.with_robot(robot)
    if not map:
        raise ConfigError(
            f"{path}: is not a run folder: give `map`, which defines the columns",
            code="RID-OPTION-NEEDS",
        )
    return Recording._import_files((path, *(Path(each) for each in further)), str(map), robot, rows)
