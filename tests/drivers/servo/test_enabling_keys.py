"""Drives that differ during enabling, and the cell-file keys for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.errors import DeviceTimeoutError, SafetyStop
from drivers.servo.axes import CanServoAxes
from drivers.servo.cia402 import PowerState
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


def test_a_drive_without_the_follows_bit_is_enabled_if_the_cell_file_says_so(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> None:
    bench = make_bench(cell.model_copy(update={"servo": ServoProfile(follows_bit=False)}))
    for drive in bench.drives:
        drive.follows = 0
    bench.enabled()
    assert all(drive.state is PowerState.OPERATION_ENABLED for drive in bench.drives)


@pytest.mark.parametrize(("timeout_s", "enabled"), [(4.0, False), (6.0, True)])
def test_a_drive_that_takes_five_seconds_needs_a_longer_timeout_in_the_cell_file(
    make_bench: Callable[[CellConfig], Bench],
    cell: CellConfig,
    monkeypatch: pytest.MonkeyPatch,
    timeout_s: float,
    enabled: bool,
) -> None:
    servo = ServoProfile(enable_timeout_s=timeout_s)
    bench = make_bench(cell.model_copy(update={"servo": servo}))
    bench.axes.bring_up()
    bench.axes.start()
    drive = bench.drives[1]
    obey, begun_s = drive.obey, bench.bus.now_s
    late = lambda word: obey(word) if bench.bus.now_s - begun_s > 5.0 else None  # noqa: E731
    monkeypatch.setattr(drive, "obey", late)
    if enabled:
        bench.axes.enable()
        assert drive.state is PowerState.OPERATION_ENABLED
    else:
        with pytest.raises(DeviceTimeoutError) as caught:
            bench.axes.enable()
        assert caught.value.refusal == "RID-DRIVE-NOT-ENABLED"


def test_no_drive_is_started_after_a_stop_order(bench: Bench) -> None:
    axes = CanServoAxes(bench.link, bench.cell, bench.robot, stopped=lambda: True)
    axes.bring_up()
    with raises_code(SafetyStop, "RID-STOP-ORDERED"):
        axes.start()
    assert not any(drive.state.powered for drive in bench.drives)
