"""`rid-daq watch` reads the drives without power, and ends when the user requests it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.load import load_cell
from rid_daq.operations.cell import watched_drives
from rid_daq.operations.cell.watch import WatchRequest, WatchResult
from rid_daq.operations.cell.watched_drives import watch_drives
from rid_daq.requests.cell_options import Simulation
from rid_daq.terminal.console import Console

ENABLED = 0x0027
"""Bits of the statusword that a drive with power has."""


@pytest.fixture
def rings(monkeypatch: pytest.MonkeyPatch) -> list[Ring]:
    """Ring buffers that the operation has created."""
    made: list[Ring] = []

    class KeptRing(Ring):
        @classmethod
        def create(cls, joints: int, capacity: int) -> Ring:
            made.append(Ring.create(joints, capacity))
            return made[-1]

    monkeypatch.setattr(watched_drives, "Ring", KeptRing)
    return made


def test_the_rows_contain_the_pose_and_no_drive_has_power(rings: list[Ring]) -> None:
    loaded = load_cell("ir361")
    request = WatchRequest(cell="ir361", seconds=0.4)
    watched = watch_drives(loaded, request, Console(as_json=True))
    (ring,) = rings
    rows = np.frombuffer(ring.latest(1000), dtype=row_dtype(ring.joints))
    assert len(rows) == watched.cycles == 50
    assert rows["valid"].all()
    assert (rows["statusword"] & ENABLED != ENABLED).all()
    assert np.isnan(rows["target_position"]).all()
    assert np.diff(rows["time_s"]) == pytest.approx(loaded.config.cycle_time_s, abs=1e-4)
    document = WatchResult("ir361", watched).document()
    (first, *_) = json.loads(json.dumps(document))["joints"]
    assert math.degrees(first["position_min"]) == pytest.approx(5.73, abs=0.01)
    assert first["position_min"] == rows["position"][:, 0].min()
    assert first["answers_missing"] == 0


def test_a_stop_request_ends_the_operation(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load_cell("ir361")
    control = ControlBlock.create()
    monkeypatch.setattr(ControlBlock, "create", classmethod(lambda _: control))
    run_cycle = watched_drives._Watch._run_cycle

    def stop_at_third_cycle(watch: watched_drives._Watch, *arguments: object) -> None:
        run_cycle(watch, *arguments)  # type: ignore[arg-type]
        if watch.cycle == 3:
            control.program.request_stop(StopCode.STOP_COMMAND)

    monkeypatch.setattr(watched_drives._Watch, "_run_cycle", stop_at_third_cycle)
    watched = watch_drives(loaded, WatchRequest(cell="ir361"), Console(as_json=True))
    assert watched.cycles == 3
    assert control.task_gone
    assert control.task.ramp_s == 0.0


@pytest.mark.slow
def test_temperatures_are_read_if_the_cell_has_a_drive_monitor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    control = ControlBlock.create()
    monkeypatch.setattr(ControlBlock, "create", classmethod(lambda _: control))
    request = WatchRequest(cell="kr15", seconds=2.0, simulation=Simulation(pace=1.0))
    watch_drives(load_cell("kr15"), request, Console(as_json=True))
    found = control.monitor.temperatures(control.program.monitored)
    assert len(found) == 6
    assert all(280.0 < value < 340.0 for value in found)
