"""`run_blocks`: blocks of a run on pages; `warm_up_plot`: power during a warm-up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acquisition.runs.catalogue import find_run_below
from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from identification.payload.warm_up import FEWEST_PERIODS, period_powers, power_change_percent
from rid_daq.blocks.block import AnyBlock, note_blocks
from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.operations.payload.session_states import WARM_UP, SessionFile
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.section_blocks.estimate import fit_verdict
from rid_daq.report.section_blocks.sections import BLOCKS_BY_SECTION
from rid_daq.report.section_blocks.verdict import verdict_blocks
from rid_daq.report_page.run_robot import run_robot_blocks
from rid_daq.runs.run_data import SESSION, RunData


def run_blocks(folder: RunFolder, names: Sequence[str] = ()) -> Iterator[AnyBlock]:
    """Yield the verdict, sections of the result, and the warm-up of a payload session.

    Args:
        folder: The run.
        names: Names of the sections; `verdict` for verdict and warm-up (default: all). Views of
            the robot are drawn only if `robot` is named.

    Raises:
        RidDaqError: A file of the run cannot be read.
    """
    if folder.file(RESULT).exists():
        result = read_result(folder)
        if not names or "verdict" in names:
            yield from verdict_blocks(result.verdict)
        yield from note_blocks(result.notes or ())
        if result.estimate is not None and "estimate" in names:
            yield fit_verdict(result.estimate)
        for name, section in result.sections():
            if not names or name in names:
                yield from BLOCKS_BY_SECTION[name](section)
        if "robot" in names:
            yield from run_robot_blocks(folder, result)
    if (not names or "verdict" in names) and folder.file(SESSION).exists():
        yield from _warm_up(folder)


def _warm_up(folder: RunFolder) -> Iterator[AnyBlock]:
    """Yield the plot of a payload session's warm-up, if it had one and stored its limit."""
    state = SessionFile.read(folder)
    fact = state.facts.get("warm_up")
    run = state.done.get(WARM_UP)
    settled = fact.get("settled_percent") if isinstance(fact, dict) else None
    if run is not None and isinstance(settled, (int, float)):
        recording = RunData.load(
            find_run_below(folder.path.parent, run), changing_load=True
        ).recording
        powers = period_powers(recording).tolist()
        yield warm_up_plot(recording.joint_names, powers, float(settled))


def warm_up_plot(
    joint_names: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
) -> Plot:
    """Return the plot of each joint's mean power in each period, and of its change per period.

    Args:
        joint_names: Base to flange.
        power_w: Mean mechanical power of each joint, one row per whole period [W], as
            `period_powers` returns it.
        settled_percent: Limit of the change per period of a warm joint [%].
    """
    power = np.asarray(power_w, dtype=np.float64).reshape(-1, len(joint_names))
    ends = range(FEWEST_PERIODS, len(power) + 1)
    change = np.array([power_change_percent(power[:last]) for last in ends])
    change = change.reshape(-1, len(joint_names))
    periods = [float(number) for number in range(1, len(power) + 1)]
    widest = None if len(change) else 2.0 * settled_percent
    return Plot(
        name="warm_up",
        panels=(
            Panel(
                title="mean power in each period",
                x=Axis("period", counts=True),
                y=Axis("power", "W"),
                lines=_lines(joint_names, periods, power),
                height_px=260,
            ),
            Panel(
                title=f"change per period, settled at {settled_percent:g} %",
                x=Axis("period", counts=True),
                y=Axis("change", "%", least=None if widest is None else -widest, most=widest),
                lines=_lines(joint_names, periods[FEWEST_PERIODS - 1 :], change),
                limits=(-settled_percent, settled_percent),
                height_px=200,
                zooms_with_previous=True,
            ),
        ),
    )


def _lines(
    joint_names: Sequence[str],
    x: Sequence[float],
    values: FloatArray,
) -> tuple[Line, ...]:
    return tuple(
        Line(joint, tuple(x), values[:, j].tolist(), j) for j, joint in enumerate(joint_names)
    )
