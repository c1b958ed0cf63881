"""Watch for events of drives and other nodes: events are reported, and the memory is bounded."""

from __future__ import annotations

import pytest

from config.cell.drive_safety import DriveSafety
from drivers.canopen.frames import Frame
from drivers.interfaces.servo_axes import EventKind
from drivers.servo.drive_watch import MOST_EVENTS, DriveWatch

SAFETY = DriveSafety(quick_stop_deceleration_rad_s2=10.0, following_error_rad=0.1)
OTHER_DEVICES = [Frame(0x310 + number, b"") for number in range(2 * MOST_EVENTS)]
FOREIGN = [
    pytest.param(Frame(0x201, bytes(6)), id="commands"),
    pytest.param(Frame(0x601, bytes(8)), id="SDO requests"),
    pytest.param(Frame(0x655, bytes(8)), id="SDO requests to another"),
    pytest.param(Frame(0x000, b"\x01\x01"), id="NMT"),
]


@pytest.fixture
def armed() -> DriveWatch:
    watch = DriveWatch(("joint",), (1,), SAFETY)
    watch.arm(0.0)
    return watch


@pytest.mark.parametrize("frame", FOREIGN)
def test_another_master_is_reported_with_many_other_devices_on_the_bus(
    armed: DriveWatch, frame: Frame
) -> None:
    for other in OTHER_DEVICES:
        armed.handle(other, 0.0)
    armed.take_events()
    for _ in range(3):
        armed.handle(frame, 0.1)
    (event,) = armed.take_events()
    assert (event.kind, event.code) == (EventKind.FOREIGN_MASTER, frame.cob_id)


@pytest.mark.parametrize("frame", FOREIGN)
def test_another_master_after_too_many_events_is_reported_the_next_time(
    armed: DriveWatch, frame: Frame
) -> None:
    for other in OTHER_DEVICES:
        armed.handle(other, 0.0)
    armed.handle(frame, 0.0)
    assert len(armed.take_events()) == MOST_EVENTS
    armed.handle(frame, 0.1)
    (event,) = armed.take_events()
    assert event.kind is EventKind.FOREIGN_MASTER


def test_the_number_of_stored_unknown_identifiers_is_limited(armed: DriveWatch) -> None:
    for other in OTHER_DEVICES:
        armed.handle(other, 0.0)
        armed.take_events()
    assert len(armed._seen) == MOST_EVENTS
    assert armed.unexpected_frames == len(OTHER_DEVICES)
