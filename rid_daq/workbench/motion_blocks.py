"""`motion_blocks`: description and plots of a motion before it is executed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray
from config.load import LoadedCell
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward
from identification.design.two_harmonic import condition_number
from identification.elasticity.limit_torque import limit_torque
from identification.estimation.at_temperature import depends_on_temperature
from rid_daq.blocks.block import AnyBlock, Text
from rid_daq.blocks.formats import duration, number
from rid_daq.blocks.plot import Axis, Colour, Line, Panel, Plot
from rid_daq.operations.cell_files import read_motion_for, read_torque_model
from rid_daq.operations.stated_payload import state_payload
from rid_daq.terminal.choices import DEFAULT_RUNS

AT_REFERENCE: Final = "Friction at its reference temperature."
COLD_OR_WARM: Final = "Friction of the cold or the warm robot, whichever needs more torque."
AXES: Final = "xyz"
VIEWS: Final = ((0, 1), (0, 2), (1, 2))
DRAWN_POINTS: Final = 1000


def motion_blocks(
    cell: LoadedCell,
    path: Path,
    model: Path | None = None,
    payload: str | None = None,
    runs: Path = DEFAULT_RUNS,
) -> Iterator[AnyBlock]:
    """Yield the description of a motion file, and its plots.

    Args:
        cell: The cell that will execute the motion.
        path: The file.
        model: A model whose expected torque is drawn; `record` compares the same torque with the
            limits (`limit_torque`).
        payload: Payload on the flange, as in a request; without effect without a model.
        runs: Folder of the run folders.

    Raises:
        ConfigError, LimitError: The file is invalid or of another robot, the motion exceeds a
            limit; or the model is of another robot, or contains a payload that `payload` does not
            state.
        EstimationError: The payload failed its verdict, or is not fully determined.
    """
    motion = read_motion_for(path, cell)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    one = samples.whole(1)
    text = f"{motion.describe()} Duration: {duration(samples.duration_s)}."
    if (excitation := FourierMotion.of(motion)) is not None:
        text += f" Condition number: {number(condition_number(cell.robot, excitation), 3)}."
    yield Text(text=text)
    torque, caption = None, ""
    if model is not None:
        estimate = read_torque_model(model, cell.robot, despite_misfit=True)[0]
        estimate = state_payload(estimate, model.name, payload, runs).estimate
        moved = (one.position, one.velocity, one.acceleration)
        torque = limit_torque(estimate, *moved, one.sample_period_s)
        if depends_on_temperature(estimate).any():
            caption = AT_REFERENCE if estimate.warming is None else COLD_OR_WARM
    yield limits_plot(one, cell.robot, torque, caption)
    yield tool_plot(one, cell.robot, cell.config.workspace)


def limits_plot(
    samples: MotionSamples,
    robot: RobotDescription,
    torque_nm: FloatArray | None = None,
    caption: str = "",
) -> Plot:
    """Return a plot of positions, speeds, accelerations, and given torques in percent of limits.

    For positions, ±100 % are the two ends of the range.

    Args:
        samples: The planned motion; of a periodic motion one period.
        robot: Robot with the limits.
        torque_nm: Shape (samples, joints). Torque that a model expects [N m or N].
        caption: Temperature that was assumed for the model's friction.
    """
    limits = [joint.limits for joint in robot.joints]
    low, high = (
        np.array([getattr(each, f"position_{end}") for each in limits]) for end in ("min", "max")
    )
    shares = {"position": 2.0 * (samples.position - low) / (high - low) - 1.0}
    values = {"velocity": samples.velocity, "acceleration": samples.acceleration}
    if torque_nm is not None:
        values["torque"] = torque_nm
    for name, of in values.items():
        shares[name] = of / np.array([getattr(each, name) for each in limits])
    step = _row_stride(samples)
    time_s = (samples.sample_period_s * np.arange(0, len(samples.position), step)).tolist()
    panels: list[Panel] = []
    for name, share in shares.items():
        peak = 100.0 * float(np.abs(share).max())
        least, most = (-108.0, 108.0) if peak <= 100.0 else (None, None)
        reference = "range" if name == "position" else "limit"
        panels.append(
            Panel(
                title=f"{name}: at most {peak:.0f} % of the {reference}",
                x=Axis("time", "s"),
                y=Axis(name, f"% of {reference}", least=least, most=most),
                lines=tuple(
                    Line(joint, time_s, (100.0 * share[::step, j]).tolist(), j, is_named=not panels)
                    for j, joint in enumerate(robot.joint_names)
                ),
                limits=(-100.0, 100.0),
                zooms_with_previous=bool(panels),
            )
        )
    return Plot(name="motion", panels=tuple(panels), caption=caption)


def tool_plot(samples: MotionSamples, robot: RobotDescription, workspace: Workspace) -> Plot:
    """Return a plot of the tool's path in the base frame, with the workspace's boxes and walls.

    Args:
        samples: The planned motion.
        robot: Robot with its kinematics.
        workspace: The cell's walls and boxes.
    """
    step = _row_stride(samples)
    tool = forward(Chain.from_description(robot), samples.position[::step])
    is_main = samples.phase[::step] == Phase.MAIN
    views = tuple(_view(tool, is_main, workspace, pair) for pair in VIEWS)
    return Plot(name="tool", panels=views, columns=len(views))


def _view(
    tool: FloatArray,
    is_main: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    workspace: Workspace,
    pair: tuple[int, int],
) -> Panel:
    i, j = pair
    x, y = tool[:, i].tolist(), tool[:, j].tolist()
    main = tuple(value if inside else None for value, inside in zip(y, is_main, strict=True))
    ends = [(min(0.0, values.min()), max(0.0, values.max())) for values in (tool[:, i], tool[:, j])]
    return Panel(
        title=f"path of the tool, {AXES[i]} and {AXES[j]}",
        x=Axis(f"{AXES[i]} of the base", "m"),
        y=Axis(f"{AXES[j]} of the base", "m"),
        lines=(
            *_boxes(workspace, i, j),
            Line("whole motion", x, y, "faint", width=4.0),
            Line("main part", x, main, "blue", width=2.0),
            Line("base", (0.0,), (0.0,), "ink", points=True, marker="square"),
            *_walls(workspace, i, j, ends),
        ),
        height_px=320,
        is_to_scale=True,
    )


def _boxes(workspace: Workspace, i: int, j: int) -> Iterator[Line]:
    """Yield the outlines of the boxes: red for keep-out boxes, grey for stay-in boxes."""
    for box in workspace.boxes:
        (left, right), (low, high) = ((box.min_m[i], box.max_m[i]), (box.min_m[j], box.max_m[j]))
        stroke: Colour = "red" if box.keep == "out" else "soft"
        label = "keep out" if box.keep == "out" else "stay in"
        x, y = (left, right, right, left, left), (low, low, high, high, low)
        yield Line(label, x, y, stroke, is_area=True)


def _walls(workspace: Workspace, i: int, j: int, ends: list[tuple[float, float]]) -> Iterator[Line]:
    """Yield a line for each wall or floor that is perpendicular to the view.

    A line is as long as the path, with the base.
    """
    for count, wall in enumerate(workspace.planes, start=1):
        for axis, (x_ends, y_ends) in ((i, (None, ends[1])), (j, (ends[0], None))):
            if abs(wall.normal[axis]) > 1.0 - 1e-6:
                at = (wall.offset_m / wall.normal[axis],) * 2
                yield Line(
                    f"wall {count}",
                    x_ends or at,
                    y_ends or at,
                    "red",
                    dash="dashed",
                    is_named=False,
                )


def _row_stride(samples: MotionSamples) -> int:
    """Return the step between rows that are drawn, so that at most `DRAWN_POINTS` are drawn."""
    return max(1, -(-len(samples.position) // DRAWN_POINTS))
