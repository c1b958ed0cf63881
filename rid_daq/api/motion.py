"""`Motion`: a planned motion, sampled at a cycle time; `design` and `retime`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.kinds.joint_table import JointTableMotion
from acquisition.motion.motion_file import AnyMotion, load_motion
from acquisition.motion.samples import MotionSamples
from acquisition.motion.trajectory_file import MOST_BYTES
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.json_file import read_content
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, to_yaml
from rid_daq.api.arguments import (
    as_numbers,
    as_path,
    require,
    require_callable,
    require_stated_payload,
    validated,
    with_options,
)
from rid_daq.api.console import ProgressCallback, SilentConsole, text_of
from rid_daq.api.curves import curves_plot
from rid_daq.api.model import Model
from rid_daq.api.payload import Payload
from rid_daq.api.payload_argument import to_request_payload
from rid_daq.api.robot import Robot
from rid_daq.api.temporary_files import (
    CELL,
    MADE,
    MODEL,
    MOTION,
    request_folder,
    without_files,
)
from rid_daq.blocks.block import AnyBlock, Next, Text
from rid_daq.blocks.plot import Axis
from rid_daq.operations.experiment.design import DesignRequest
from rid_daq.operations.experiment.design import run as run_design
from rid_daq.operations.path.retime import RetimeRequest, RetimeResult
from rid_daq.operations.path.retiming import retime_motion
from rid_daq.operations.start.starting_cell import starting_cell
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

PERIODS = 16
_TABLES: Final = (".csv", ".tsv", ".txt")


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion, planned within the limits of a robot, one row per cycle.

    `print` shows the result of the search for the motion; `plot` draws the motion. `save` writes a
    motion file for `rid-daq record`.

    Attributes:
        description: Content of the motion file.
        samples: The rows, one per cycle.
        cell: The robot or cell for which the motion is planned.
        shown: Texts and tables about the search for the motion; empty without a search.
    """

    description: AnyMotion
    samples: MotionSamples
    cell: Robot | str | Path
    shown: tuple[AnyBlock, ...] = ()

    @classmethod
    def load(cls, path: str | Path, *, cell: Robot | str | Path) -> Self:
        """Return the motion of a motion file, or of a trajectory file of a planner.

        Args:
            path: A motion file; or a trajectory as CSV, or as JSON or YAML of ROS or MoveIt, as
                `file` of the motion kind `joint_table` (docs/reference/files.md).
            cell: A robot; or a cell, by its bundled name or its file, whose cycle time and limits
                apply.

        Raises:
            ConfigError: The file is neither of them, or the motion exceeds a limit.
        """
        path = as_path("path", path)
        with request_folder() as folder:
            loaded = load_cell(cell_reference(cell, folder))
        if not _is_trajectory(path):
            return cls._plan(load_motion(str(path)), loaded, cell)
        own = {"kind": "joint_table", "robot": loaded.robot.name, "file": str(path.absolute())}
        table = validated(JointTableMotion, own).with_file_data(path.parent)
        return cls._plan(table, loaded, cell)

    @classmethod
    def through(
        cls,
        points: npt.ArrayLike,
        *,
        cell: Robot | str | Path,
        speed_fraction: float = 0.5,
    ) -> Self:
        """Return a smooth curve through poses, from rest to rest.

        Args:
            points: Shape (poses, joints). Positions [rad or m].
            cell: As for `load`.
            speed_fraction: Fraction of the velocity and acceleration limits that the curve uses.

        Raises:
            ConfigError: The curve exceeds a limit, or a pose does not have one value per joint.
        """
        rows = as_numbers("points", points)
        if rows.ndim != 2:
            raise ConfigError(
                f"points of shape {rows.shape}: give (poses, joints)", code="RID-API-ARGUMENT"
            )
        with request_folder() as folder:
            loaded = load_cell(cell_reference(cell, folder))
        own = {"kind": "joint_path", "robot": loaded.robot.name}
        table = tuple(map(tuple, rows.tolist()))
        motion = validated(
            JointPathMotion, {**own, "points": table, "speed_fraction": speed_fraction}
        )
        return cls._plan(motion, loaded, cell)

    @classmethod
    def _plan(cls, motion: AnyMotion, loaded: LoadedCell, cell: Robot | str | Path) -> Self:
        return cls(motion, motion.plan(loaded.robot, loaded.config.cycle_time_s).whole(), cell)

    @property
    def time_s(self) -> FloatArray:
        """Shape (samples,). Times from the start [s]."""
        return np.arange(len(self.samples), dtype=np.float64) * self.samples.sample_period_s

    @property
    def position(self) -> FloatArray:
        """Shape (samples, joints). Positions [rad or m]."""
        return self.samples.position

    @property
    def velocity(self) -> FloatArray:
        """Shape (samples, joints). Velocities [rad/s or m/s]."""
        return self.samples.velocity

    @property
    def acceleration(self) -> FloatArray:
        """Shape (samples, joints). Accelerations [rad/s² or m/s²]."""
        return self.samples.acceleration

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last [s]."""
        return self.samples.duration_s

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the motion file (YAML).

        Args:
            path: The file.
            overwrite: Replace an existing motion file of rid-daq.

        Raises:
            ConfigError: The file exists already (RID-OUTPUT-EXISTS), or is not such a motion file.
            RecordingError: The file cannot be written.
        """
        path = as_path("path", path)
        refuse_output(path, overwrite, made_file.MOTION)
        origin = "Motion by rid-daq, verified within the limits of the robot."
        comment = f"{origin} {self.description.describe()}"
        write_whole(path, to_yaml(self.description, comment).encode())

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the result of the search, or a description of the motion, and curves over time."""
        if not self.shown:
            yield Text(text=f"{self.description.describe()} {self.duration_s:.1f} s in all.")
        yield from self.shown
        position, velocity = Axis("position", "rad or m"), Axis("velocity", "rad/s or m/s")
        parts = ((position, self.position), (velocity, self.velocity))
        yield curves_plot(self.samples.joint_names, Axis("time", "s"), self.time_s, parts)

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return str(self)


def _is_trajectory(path: Path) -> bool:
    """Return True if a file contains rows of a planner, and is not a motion file."""
    if path.suffix.lower() in _TABLES:
        return True
    if not path.is_file():
        return False  # a bundled motion, or no file
    text = read_content(path, MOST_BYTES)
    return b"time_from_start" in text and re.search(rb"^kind\s*:", text, re.MULTILINE) is None


def design(
    cell: Robot | str | Path,
    *,
    kind: str = "excitation",
    period_s: float | None = None,
    periods: int = PERIODS,
    model: Model | None = None,
    options: Mapping[str, object] | None = None,
    progress: ProgressCallback | None = None,
) -> Motion:
    """Choose a motion for an identification, within the limits of a robot or cell.

    An excitation is a Fourier series for each joint. A search from many starts, with exact
    gradients, maximises the information about the base parameters (docs/theory.md 10). Ramps,
    positions between the samples, workspace and self-collision are checked; torques too, if a model
    or `cad` in the robot file states masses. Ctrl-C ends the search with the best motion so far.

    Args:
        cell: A robot; or a cell, by its bundled name or its file, whose cycle time, workspace and
            plate apply.
        kind: excitation; constant-velocity or reversed, for friction alone; multisine, for velocity
            loops.
        period_s: Period of an excitation [s], a whole number of control cycles; about 10 s if None.
        periods: Number of periods to record.
        model: An identified model, for the torque limits.
        options: Further fields of the request `design` (docs/reference/openapi.json), such as
            {"excitation": {"starts": 4, "seed": 1}}.
        progress: Called with the step, the number of starts done, and their total.

    Raises:
        ConfigError: No motion keeps every limit (RID-DESIGN-NONE), or an option is invalid.
        EstimationError: The model contains a payload (RID-PAYLOAD-UNSTATED), or has
            `Model.problems` (RID-MODEL-MISFIT; `despite_misfit` in `options` accepts it).
        KeyboardInterrupt: Ctrl-C before any motion was found.
    """
    require("kind", kind, str)
    require_callable("progress", progress)
    if model is not None:
        require_stated_payload(require("model", model, Model).estimate)
    asked = with_options({}, options)
    if kind in ("excitation", "reversed"):
        own = {"period_s": period_s, "periods": periods}
        asked["excitation"] = {**own, **with_options({}, asked.get("excitation"))}
    elif (period_s, periods) != (None, PERIODS):
        raise ConfigError(
            f"period_s and periods have no effect on a motion of kind {kind!r}; leave them out, or"
            " give the fields of this kind as options",
            code="RID-OPTION-NO-EFFECT",
        )
    with request_folder() as folder:
        asked |= {"cell": cell_reference(cell, folder), "output": folder / MADE, "kind": kind}
        if model is not None:
            model.save(folder / MODEL)
            asked["model"] = folder / MODEL
        request = DesignRequest.of(asked, shown="design")
        try:
            result = run_design(request, SilentConsole(callback=progress))
        except SystemExit:
            raise KeyboardInterrupt from None
        shown = public_blocks(result.blocks(), folder)
    return Motion(result.designed.motion, result.designed.samples.whole(), cell, shown)


def retime(
    motion: Motion,
    model: Model,
    *,
    payload: Payload | str | None = None,
    confidence: float = 0.95,
    margin: float = 0.0,
    despite_misfit: bool = False,
    options: Mapping[str, object] | None = None,
) -> Motion:
    """Return the motion with the fastest timing that its speed and torque limits allow.

    The path is unchanged, and nothing moves. The timing is time-optimal within the limits of speed,
    acceleration and torque: the torques tau = Y(q, v, a) beta, plus a margin for the uncertainty of
    the model, stay within the torque limits (docs/theory.md 13.6).

    Args:
        motion: A motion along a path, such as `Motion.through`.
        model: The identified robot.
        payload: Payload on the flange: an identified payload, `model` (the model's own payload) or
            `none`.
        confidence: Probability with which each torque keeps its limit at one instant; 0 uses the
            model without a margin.
        margin: Additional fraction of the limits of torques and base wrench that is kept free.
        despite_misfit: Accept a model with `Model.problems`.
        options: Further fields of the request `retime`, such as {"jerk": (80.0,)}.

    Raises:
        ConfigError: The motion has no path (RID-MOTION-KIND) or is of another robot, or an option
            is invalid.
        EstimationError: The model has `Model.problems` (RID-MODEL-MISFIT); the payload did not pass
            its verdict; or the model contains a payload, but `payload` is None
            (RID-PAYLOAD-UNSTATED).
        LimitError: A limit cannot be kept; the text names the limit and, if known, the pose.
    """
    described = require("motion", motion, Motion).description
    require("model", model, Model)
    with request_folder() as folder:
        (folder / MOTION).write_text(to_yaml(described), encoding="utf-8")
        model.save(folder / MODEL)
        request = RetimeRequest.of(
            with_options(
                {
                    "cell": cell_reference(motion.cell, folder),
                    "motion": folder / MOTION,
                    "model": folder / MODEL,
                    "output": folder / MADE,
                    "payload": to_request_payload(payload, model, folder),
                    "confidence": confidence,
                    "margin": margin,
                    "despite_misfit": despite_misfit,
                },
                options,
            ),
            shown="retime",
        )
        result = RetimeResult(request, retime_motion(request))
        loaded, shown = load_cell(request.cell), public_blocks(result.blocks(), folder)
    planned = Motion._plan(result.made.timed.motion, loaded, motion.cell)
    return replace(planned, shown=shown)


def cell_reference(cell: Robot | str | Path, folder: Path) -> str:
    """Return a cell's name or file for an operation; for a robot, write a cell file into a folder.

    Like the cell of `rid-daq init`, a robot's cell has a cycle of 8 ms and no workspace.
    """
    if isinstance(cell, str | Path):
        return str(as_path("cell", cell))
    require("cell", cell, Robot)
    config = starting_cell(cell.description)
    config = config.model_copy(update={"simulated": False, "plant": None})
    cell.save(folder / "robot.yaml")
    (folder / CELL).write_text(to_yaml(config), encoding="utf-8")
    return str(folder / CELL)


def public_blocks(blocks: Iterator[AnyBlock], folder: Path) -> tuple[AnyBlock, ...]:
    """Return an operation's blocks, without next commands and names of temporary files."""
    return tuple(
        each.model_copy(update={"text": without_files(each.text, folder)})
        if isinstance(each, Text)
        else each
        for each in blocks
        if not isinstance(each, Next)
    )
