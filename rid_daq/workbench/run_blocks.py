"""`run_blocks`: what pages show of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from acquisition.runs.catalogue import find_run_inside
from acquisition.runs.folder import RunFolder
from identification.payload.warm_up import period_powers
from rid_daq.blocks.block import AnyBlock, note_blocks
from rid_daq.operations.payload.session_state import STATE, SessionState
from rid_daq.operations.payload.session_steps import WARM_UP
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.shown.estimate import fit_verdict
from rid_daq.report.shown.sections import SHOWN
from rid_daq.report.shown.verdict import verdict_blocks
from rid_daq.runs.run_data import RunData
from rid_daq.workbench.warm_up_plot import warm_up_plot


def run_blocks(folder: RunFolder, names: Sequence[str] = ()) -> Iterator[AnyBlock]:
    """Yield the verdict, sections of the result, and the warm-up of a payload session.

    Args:
        folder: The run.
        names: Of the sections; the verdict is called `verdict`. All if empty.

    Raises:
        RidDaqError: One of its files cannot be read.
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
                yield from SHOWN[name](section)
    if folder.file(STATE).exists():
        yield from _warm_up(folder)


def _warm_up(folder: RunFolder) -> Iterator[AnyBlock]:
    """Yield the warm-up of a payload session that had one and noted its limit."""
    state = SessionState.read(folder)
    fact = state.facts.get("warm_up")
    run = state.done.get(WARM_UP)
    settled = fact.get("settled_percent") if isinstance(fact, dict) else None
    if run is not None and isinstance(settled, (int, float)):
        recording = RunData.load(find_run_inside(folder.path.parent, run)).recording
        powers = period_powers(recording).tolist()
        yield warm_up_plot(recording.joint_names, powers, float(settled))
