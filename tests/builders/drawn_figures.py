"""All figures of reports and pages, made from results of commands and from computed data."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from acquisition.motion.samples import MotionSamples
from config.load import load_cell, load_robot
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.payload.body import PARAMETERS, PayloadBody
from identification.payload.estimate import PayloadEstimate
from identification.payload.known import KnownPayloadValue
from rid_daq.blocks.plot import Plot
from rid_daq.figures.plot_tables import PlotTable, plot_tables
from rid_daq.report.result import Result
from rid_daq.report.section_blocks.bode import bode_plot
from rid_daq.report.section_blocks.centre_of_gravity import CentreOfGravity, centre_plot
from rid_daq.report.section_blocks.curves import spectrum_plot, torque_plot
from rid_daq.report.section_blocks.friction import friction_plot
from rid_daq.report.section_blocks.loop_timing import lateness_plot
from rid_daq.report.section_blocks.retiming import way_plot
from rid_daq.report.section_blocks.runs import stop_plot
from rid_daq.report.section_blocks.tracking import path_plots
from rid_daq.report.section_blocks.validation import truth_plot
from rid_daq.workbench.motion_blocks import limits_plot, tool_plot
from rid_daq.workbench.robot_history import HistoryEntry, QuantityHistory
from rid_daq.workbench.run_blocks import warm_up_plot
from tests.builders.invented import whole_result

WRITTEN = Path(__file__).parents[1] / "rid_daq" / "report" / "results"
JOINTS = ("axis1", "axis2", "axis3")


def written(kind: str) -> Result:
    """Return a stored result of a command on a bundled cell, with long curves shortened."""
    return Result.model_validate_json((WRITTEN / f"{kind}.json").read_bytes())


def invented_result() -> Result:
    """Return a result with long curves and invented numbers."""
    return Result.model_validate_json(json.dumps(whole_result()))


def six_axes() -> MotionSamples:
    """Return a planned excitation of the bundled six-axis arm."""
    cell = load_cell("kr15")
    options = TwoHarmonicOptions(
        4.8, highest_harmonic=4, limit_fraction=0.35, tries=1, seed=3, periods=4
    )
    cycle_s = cell.config.cycle_time_s
    return design_two_harmonic(cell.robot, options, cycle_s).plan(cell.robot, cycle_s)


def payload(*, held: str = "", unseen: str = "") -> PayloadEstimate:
    """Return a payload of 5 kg with its centre of gravity 20, -10 and 80 mm from the flange.

    Args:
        held: Name of a parameter that was known before the measurement; empty for none.
        unseen: Name of a parameter that the motion cannot determine; empty for none.
    """
    body = PayloadBody(5.0, np.array([0.02, -0.01, 0.08]), np.diag([0.04, 0.05, 0.02]))
    names: list[str] = list(PARAMETERS)
    hidden = np.eye(10)[:, [names.index(unseen)]] if unseen else np.zeros((10, 0))
    root = np.diag([0.01, *(2e-3,) * 3, *(1e-3,) * 6])
    root[1, 3] = 1.5e-3
    return PayloadEstimate(
        robot=load_robot("ur10e"),
        procedure="together",
        values=body.parameters,
        covariance=root @ root.T,
        covariance_noise=0.25 * root @ root.T,
        gain_slopes=np.zeros((10, 6)),
        unseen=hidden,
        condition_number=12.0,
        known=(KnownPayloadValue(held, 5.0, 0.0),) if held else (),
        residual_nm=np.full(6, 0.5),
        payload_nm=np.full(6, 10.0),
        equations=4000,
        torque_nm=np.full(6, 50.0),
        contradictions=np.zeros(1 if held else 0),
    )


def all_figures() -> dict[str, Plot]:
    long, cell = invented_result(), load_cell("kr15")
    curves, tracking, friction = long.curves, long.tracking, written("friction").friction
    loops = written("velocity_loops").velocity_loops
    assert curves is not None
    assert curves.torque is not None
    assert curves.spectrum is not None
    assert tracking is not None
    assert friction is not None
    assert loops is not None
    stopped = long.runs[0].stop_curve if long.runs else None
    late = long.timing.loops if long.timing is not None else None
    timed = written("retiming").retiming
    assert stopped is not None
    assert late is not None
    assert long.truth is not None
    assert timed is not None
    samples = six_axes().whole(1)
    torque = 20.0 * samples.acceleration
    power = np.array([8.0, 20.0, 4.0]) * (0.7 + 0.3 * np.exp(-np.arange(12.0)[:, np.newaxis] / 4))
    begun = datetime(2026, 1, 5, tzinfo=UTC)
    past = [
        HistoryEntry(
            f"RUN{i}", "weekly", (begun + timedelta(days=7 * i)).isoformat(), 20.0 + 0.1 * i, 0.5
        )
        for i in range(8)
    ]
    return {
        "motion": limits_plot(samples, cell.robot, torque),
        "tool": tool_plot(samples, cell.robot, cell.config.workspace),
        "fit": torque_plot(curves.torque),
        "spectrum": spectrum_plot(curves.spectrum),
        "bode": bode_plot(loops.axes[0]),
        **{plot.name: plot for plot in path_plots(tracking.motions[0], tracking.joints)},
        "friction": friction_plot(friction),
        "warm-up": warm_up_plot(JOINTS, power.tolist(), 1.0),
        "history": QuantityHistory("Coulomb friction of axis2", "N m", past).plot,
        "payload": centre_plot(CentreOfGravity.of(payload())),
        "stop": stop_plot(stopped),
        "lateness": lateness_plot(late[0]),
        "truth": truth_plot(long.truth),
        "retiming": way_plot(timed.ways[0], [joint.joint for joint in timed.joints]),
    }


def tables(plot: Plot) -> dict[str, PlotTable]:
    """Return the data tables of a figure by name."""
    return {each.name: each for each in plot_tables(plot)}
