"""A fault is reset only on request, and a reset powers no axis.

The next motion brings the drives up again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.errors import PreflightError
from drivers.servo.cia402 import PowerState

AT = 230


@pytest.mark.fault(9)
def test_a_drive_in_fault_is_refused_until_a_person_has_reset_it(
    serve: Any, motion: MotionSamples, measured: Callable[[str], None]
) -> None:
    rig = serve(drives=[{"kind": "fault", "joint": "axis2", "at_cycle": AT, "code": 0x7121}])
    assert rig.move(motion).reason.code is StopCode.EMERGENCY
    refused = rig.move(motion)
    assert isinstance(refused.error, PreflightError)
    assert "axis2" in str(refused.error)
    assert "(7121h)" in str(refused.error)
    with rig.session() as cell:
        drives = cell.axes.service.reset_faults()
    assert [drive.was_faulty for drive in drives] == [False, True, False]
    assert drives[1].after is PowerState.SWITCH_ON_DISABLED
    assert "7121h" in drives[1].error
    stood = rig.truth.position[-1]
    powered_before = sum(map(any, rig.truth.powered))
    rig.let_pass(0.2)
    assert sum(map(any, rig.truth.powered)) == powered_before, "a reset switched on an axis"
    assert abs(rig.truth.position[-1] - stood).max() < 1e-6
    again = rig.move(motion)
    assert again.error is None
    assert again.reason is None
    measured("motion refused until a person resets the fault; then preflight and motion")


def test_a_reset_writes_nothing_to_drives_without_a_fault(serve: Any) -> None:
    rig = serve()
    with rig.session() as cell:
        drives = cell.axes.service.reset_faults()
    assert not any(drive.was_faulty for drive in drives)
    written = [f for f in rig.frames() if 0x601 <= f.can_id <= 0x603 and f.data[0] & 0xE0 == 0x20]
    assert written == []
