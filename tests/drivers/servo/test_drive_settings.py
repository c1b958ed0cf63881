"""Settings of a drive are restored only to the saved drive, without power; storing can fail."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from config.errors import PreflightError
from drivers.servo.cia402 import PowerState
from drivers.servo.drive_settings import (
    read_drive,
    refuse_other_drive,
    restore_drive,
    store_settings,
)
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

WINDOW = (0x6065, 0)


def test_a_saved_setting_is_restored(bench: Bench) -> None:
    drive, port = bench.drives[1], bench.axes.service.ports()[1]
    saved = read_drive(port, None)
    before = drive.objects[WINDOW]
    drive.objects[WINDOW] = b"\x01\x02\x03\x04"
    refuse_other_drive(port, saved)
    (restored,) = restore_drive(port, saved, dry_run=False)
    assert (restored.node_id, restored.address, restored.restored) == (2, WINDOW, True)
    assert drive.objects[WINDOW] == before


def test_another_drive_is_refused(bench: Bench) -> None:
    saved = read_drive(bench.axes.service.ports()[1], None)
    bench.drives[1].objects[0x1018, 1] = b"\x99\x00\x00\x00"
    with raises_code(PreflightError, "RID-DRIVE-OTHER", "node 2", "1234h", "99h"):
        refuse_other_drive(bench.axes.service.ports()[1], saved)


@pytest.mark.parametrize("state", [PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE])
def test_a_drive_with_power_is_refused(bench: Bench, state: PowerState) -> None:
    port = bench.axes.service.ports()[1]
    saved = read_drive(port, None)
    bench.drives[1].state = state
    with raises_code(PreflightError, "RID-DRIVE-POWERED", "node 2"):
        refuse_other_drive(port, saved)


def test_settings_that_a_drive_did_not_store_are_not_reported_as_stored(bench: Bench) -> None:
    with raises_code(PreflightError, "RID-DRIVE-SETTINGS", "node 1"):
        store_settings(bench.axes.service.ports()[0])
