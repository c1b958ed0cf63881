"""`run_drawings`: the figures that a run has, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from bokeh.models import GridPlot

from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_run_inside
from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.errors import RecordingError
from config.load import load_bundled_or_path, load_robot
from identification.payload.file import read_payload
from identification.payload.warm_up import period_powers
from rid_daq.blocks.plot import Plot
from rid_daq.figures.motion_figure import motion_figure
from rid_daq.figures.parameters_figure import parameters_figure
from rid_daq.figures.plot_figure import plot_figure
from rid_daq.figures.warm_up_figure import warm_up_figure
from rid_daq.operations.payload.session_state import STATE, SessionState
from rid_daq.operations.payload.session_steps import WARM_UP
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.shown.bode import bode_plot
from rid_daq.report.shown.centre_of_gravity import CentreOfGravity, centre_plot
from rid_daq.report.shown.curves import spectrum_plot, torque_plot
from rid_daq.report.shown.friction import friction_plot
from rid_daq.report.shown.runs import stop_plot
from rid_daq.report.shown.tracking import path_plots
from rid_daq.runs.run_data import CELL, MOTION, ROBOT, RunData
from rid_daq.terminal.choices import PAYLOAD

T = TypeVar("T")


@dataclass(frozen=True)
class Drawing:
    """A figure that a run has.

    Attributes:
        name: As its address has it.
        title: What it shows, in words.
        make: Makes it.
    """

    name: str
    title: str
    make: Callable[[], GridPlot]


def run_drawings(folder: RunFolder) -> tuple[Drawing, ...]:
    """Return the figures that a run has, the result's first.

    Args:
        folder: The run.

    Raises:
        RidDaqError: One of its files cannot be read.
    """
    found: list[Drawing] = []
    if folder.file(PAYLOAD).exists():
        found.append(Drawing("payload", "Centre of gravity", partial(_payload, folder)))
    if folder.file(STATE).exists():
        found += _warm_up(folder)
    if folder.file(RESULT).exists():
        found += _of_result(read_result(folder))
    if folder.file(MOTION).exists():
        found.append(Drawing("motion", "Motion", partial(_motion, folder)))
    return tuple(found)


def _of_result(result: Result) -> list[Drawing]:
    found: list[Drawing] = []
    curves, estimate = result.curves, result.estimate
    for i, run in enumerate(result.runs or (), start=1):
        if run.stop_curve is not None:
            title = f"{run.stop_curve.joint} before the stop"
            found.append(Drawing(f"stop-{i}", title, partial(_declared, stop_plot, run.stop_curve)))
    if curves is not None and curves.torque is not None:
        title = "Measured and predicted torque"
        found.append(Drawing("fit", title, partial(_declared, torque_plot, curves.torque)))
    if curves is not None and curves.spectrum is not None:
        make = partial(_declared, spectrum_plot, curves.spectrum)
        found.append(Drawing("spectrum", "Spectrum of what the model leaves", make))
    if estimate is not None:
        make = partial(parameters_figure, estimate)
        found.append(Drawing("parameters", "Parameters with their intervals", make))
    if result.velocity_loops is not None:
        found += [
            Drawing(
                f"bode-{axis.joint}",
                f"Velocity loop of {axis.joint}",
                partial(_declared, bode_plot, axis),
            )
            for axis in result.velocity_loops.axes
        ]
    if result.tracking is not None:
        found += [
            Drawing(f"{plot.name}-{i}", motion.sentence, partial(plot_figure, plot))
            for i, motion in enumerate(result.tracking.motions, start=1)
            for plot in path_plots(motion, result.tracking.joints)
        ]
    if result.friction is not None:
        make = partial(_declared, friction_plot, result.friction)
        found.append(Drawing("friction", "Friction over speed", make))
    return found


def _declared(declare: Callable[[T], Plot], section: T) -> GridPlot:
    return plot_figure(declare(section))


def _payload(folder: RunFolder) -> GridPlot:
    drawn = CentreOfGravity.of(read_payload(folder.file(PAYLOAD)).estimate)
    return plot_figure(centre_plot(drawn))


def _warm_up(folder: RunFolder) -> list[Drawing]:
    """Return the figure of a payload session's warm-up, where it had one and noted its limit."""
    state = SessionState.read(folder)
    fact = state.facts.get("warm_up")
    run = state.done.get(WARM_UP)
    settled = fact.get("settled_percent") if isinstance(fact, dict) else None
    if run is None or not isinstance(settled, (int, float)):
        return []

    def make() -> GridPlot:
        recording = RunData.load(find_run_inside(folder.path.parent, run)).recording
        return warm_up_figure(recording.joint_names, period_powers(recording), float(settled))

    return [Drawing("warm-up", "Warm-up", make)]


def _motion(folder: RunFolder) -> GridPlot:
    for name in (ROBOT, CELL):
        if not folder.file(name).exists():
            raise RecordingError(
                f"run {folder.run_id} has no {name}: its motion is not drawn", code="RID-RUN-FILE"
            )
    cell = load_bundled_or_path(str(folder.file(CELL)), "cells", CellConfig)
    robot = load_robot(str(folder.file(ROBOT)))
    samples = load_motion(folder.file(MOTION)).plan(robot, cell.cycle_time_s)
    return motion_figure(samples, robot, cell.workspace)
