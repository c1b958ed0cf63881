"""The watchdogs of the drives and of the computer are tested before a motion (faults.md, rows 11
and 18).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from config.load import LoadedCell
from drivers.cell import open_cell
from drivers.servo.sdo_port import SdoPort
from drivers.servo.watchdog_test import run_watchdog_test
from rid_daq.preflight.bus_check import NOT_TESTED, watchdog_lines

Measured = Callable[[str], None]


@pytest.mark.fault(11)
@pytest.mark.fault(18)
@pytest.mark.parametrize("powered", [False, True])
def test_drives_and_computer_detect_each_others_missing_heartbeats(
    serve: Any, loaded: LoadedCell, powered: bool, measured: Measured
) -> None:
    rig = serve()
    safety = rig.config.drive_safety.model_copy(update={"trip_watchdog_with_power": powered})
    config = rig.config.model_copy(update={"drive_safety": safety})
    with open_cell(config, loaded.robot) as cell:
        trials = run_watchdog_test(cell.axes, cell.clock, config)
    rig.let_pass(0.1)
    assert all(trial.reacted_s <= 0.080 + 1e-3 for trial in trials)
    assert all(trial.detected_s <= 0.108 for trial in trials)
    assert any(map(any, rig.truth.powered)) is powered
    assert np.ptp(rig.truth.position, axis=0).max() < 0.01, (
        "an axis moved more than by the opening of its brake"
    )
    assert not any(rig.truth.powered[-1])
    acted_ms = 1e3 * max(trial.reacted_s for trial in trials)
    noticed_ms = 1e3 * max(trial.detected_s for trial in trials)
    how = trials[0].how
    measured(f"drives react after {acted_ms:.0f} ms ({how}), computer after {noticed_ms:.0f} ms")


@pytest.mark.fault(18)
def test_a_drive_with_an_inactive_watchdog_is_red(
    serve: Any, loaded: LoadedCell, measured: Measured
) -> None:
    """All settings read back correctly; only the watchdog test shows the inactive watchdog."""
    rig = serve(drives=[{"kind": "watch_asleep", "joint": "axis2"}])
    with open_cell(rig.config, loaded.robot) as cell:
        cell.axes.bring_up()
        assert {s.verdict for s in cell.axes.settings()} <= {"ok", "shown"}
        lines = watchdog_lines(cell, cleared=True)
    red = [(line.where, line.found) for line in lines if line.verdict == "red"]
    assert red == [("axis2, node 2", "never")]
    assert not any(rig.truth.powered[-1])
    measured("settings correct, but inactive watchdog: red in the preflight")


def test_a_trial_with_power_is_not_made_before_the_cell_is_clear(
    serve: Any, loaded: LoadedCell
) -> None:
    rig = serve()
    safety = rig.config.drive_safety.model_copy(update={"trip_watchdog_with_power": True})
    config = rig.config.model_copy(update={"drive_safety": safety})
    with open_cell(config, loaded.robot) as cell:
        cell.axes.bring_up()
        (line,) = watchdog_lines(cell, cleared=False)
    assert (line.where, line.what, line.verdict) == ("axis1, axis2, axis3", NOT_TESTED, "red")
    assert "--i-have-cleared-the-cell" in line.next_action
    assert not any(map(any, rig.truth.powered))


def test_a_trial_without_a_reaction_reports_never(serve: Any, loaded: LoadedCell) -> None:
    rig = serve(drives=[{"kind": "watch_asleep"}])
    with open_cell(rig.config, loaded.robot) as cell:
        trials = run_watchdog_test(cell.axes, cell.clock, rig.config)
    assert all(math.isnan(trial.reacted_s) for trial in trials)
    assert {trial.how for trial in trials} == {"operation enabled"}


def test_a_drives_silence_counts_from_when_its_heartbeat_was_switched_off(
    serve: Any, loaded: LoadedCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each switch-off takes 20 ms longer, as with many drives that are silenced one by one."""
    config, write = serve().config, SdoPort.write
    with open_cell(config, loaded.robot) as cell:

        def write_late(port: SdoPort, index: int, subindex: int, data: bytes) -> None:
            if (index, data) == (0x1017, bytes(2)):
                cell.clock.sleep_until(cell.clock.now_s() + 0.02)
            write(port, index, subindex, data)

        monkeypatch.setattr(SdoPort, "write", write_late)
        trials = run_watchdog_test(cell.axes, cell.clock, config)
    assert all(0.0 < trial.detected_s <= 0.108 for trial in trials), trials
