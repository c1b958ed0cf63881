"""Cyclic exchange on scripted drives: enabling, cycles and events."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from config.errors import (
    DeviceFaultError,
    DeviceTimeoutError,
    DriverError,
)
from drivers.canopen.frames import Frame
from drivers.canopen.heartbeat import heartbeat_frame
from drivers.canopen.nmt import NmtState
from drivers.interfaces.servo_axes import EventKind, ServoAxes
from drivers.servo.cia402 import PowerState
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

STILL = (0.0, 0.0, 0.0)


def kinds(bench: Bench) -> list[EventKind]:
    return [event.kind for event in bench.axes.take_events()]


def test_the_axes_implement_the_servo_interface(bench: Bench) -> None:
    axes: ServoAxes = bench.axes
    assert axes.joint_names == ("base", "shoulder", "elbow")


class TestEnabling:
    def test_drives_reach_operation_enabled(self, bench: Bench) -> None:
        bench.enabled()
        words = [word for word, _ in bench.commands(1)]
        assert sorted(set(words), key=words.index) == [0x0000, 0x0006, 0x0007, 0x000F]
        assert all(drive.state is PowerState.OPERATION_ENABLED for drive in bench.drives)

    def test_every_set_point_before_is_zero(self, bench: Bench) -> None:
        bench.enabled()
        for node in (1, 2, 3):
            assert {velocity for _, velocity in bench.commands(node)} == {0}

    def test_heartbeat_is_sent_before_the_drives_are_started(self, bench: Bench) -> None:
        bench.axes.bring_up()
        bench.bus.sent.clear()
        bench.axes.start()
        frames = [frame for _, frame in bench.bus.sent]
        assert frames[:4] == [
            heartbeat_frame(127, NmtState.OPERATIONAL),
            Frame(0x000, b"\x01\x01"),
            Frame(0x000, b"\x01\x02"),
            Frame(0x000, b"\x01\x03"),
        ]

    def test_sync_is_sent_every_cycle_and_heartbeat_when_due(self, bench: Bench) -> None:
        bench.enabled()
        for _ in range(50):
            bench.cycle(STILL)
        syncs = [t for t, frame in bench.bus.sent if frame.cob_id == 0x080]
        assert np.diff(syncs) == pytest.approx(0.008, abs=1e-9)
        beats = [t for t, frame in bench.bus.sent if frame.cob_id == 0x77F]
        assert max(np.diff(beats)) <= 0.025 + 0.008

    def test_a_drive_that_does_not_answer_sync_is_refused(self, bench: Bench) -> None:
        bench.axes.bring_up()
        bench.drives[1].answers_sync = False
        with raises_code(DeviceTimeoutError, "RID-DRIVE-NOT-STARTED", "time"):
            bench.axes.start()

    def test_a_drive_that_answers_sync_but_is_not_operational_is_refused(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bench.axes.bring_up()
        drive = bench.drives[1]

        def beat(generation: int) -> None:
            bench.bus.transmit(heartbeat_frame(drive.node_id, NmtState.PRE_OPERATIONAL), 0.0)
            bench.bus.at(bench.bus.now_s + 0.05, lambda: beat(generation))

        monkeypatch.setattr(drive, "beat", beat)
        with raises_code(DeviceTimeoutError, "RID-DRIVE-NOT-STARTED", "time"):
            bench.axes.start()

    def test_a_drive_that_does_not_change_its_state_is_refused(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bench.axes.bring_up()
        monkeypatch.setattr(bench.drives[2], "obey", lambda word: None)
        bench.axes.start()
        with raises_code(DeviceTimeoutError, "RID-DRIVE-NOT-ENABLED", "6041h=0040h"):
            bench.axes.enable()

    def test_a_drive_that_does_not_follow_its_command_is_refused(self, bench: Bench) -> None:
        bench.drives[0].follows = 0
        bench.axes.bring_up()
        bench.axes.start()
        with raises_code(DeviceTimeoutError, "RID-DRIVE-NOT-ENABLED", "6041h=0027h"):
            bench.axes.enable()

    def test_a_fault_during_enabling_is_not_reset(self, bench: Bench) -> None:
        bench.axes.bring_up()
        bench.axes.start()
        bench.drives[1].state = PowerState.FAULT
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "shoulder"):
            bench.axes.enable()
        assert 0x0080 not in [word for word, _ in bench.commands(2)]

    def test_an_emergency_during_enabling_is_an_error(self, bench: Bench) -> None:
        bench.axes.bring_up()
        bench.axes.start()
        bench.drives[1].emergency(0x3220)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "shoulder", "3220h"):
            bench.axes.enable()

    def test_an_axis_that_loses_power_while_others_are_enabled_is_an_error(
        self, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bench.axes.bring_up()
        bench.axes.start()
        slow, lost = bench.drives[1], bench.drives[0]
        obey = slow.obey
        monkeypatch.setattr(slow, "obey", lambda word: obey(word) if word != 0x000F else None)

        def press_emergency_stop() -> None:
            lost.state = PowerState.SWITCH_ON_DISABLED

        bench.bus.at(bench.bus.now_s + 0.1, press_emergency_stop)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "base"):
            bench.axes.enable()

    def test_no_drive_is_enabled_without_preflight(self, bench: Bench) -> None:
        with raises_code(DriverError, "RID-INTERNAL-ERROR"):
            bench.axes.enable()
        with raises_code(DriverError, "RID-INTERNAL-ERROR", "bring_up"):
            bench.axes.start()
        assert bench.bus.sent == []


class TestCycle:
    def test_measurements_are_on_the_joint_side(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.cycle(STILL)
        assert axes.answers.received.all()
        assert axes.answers.position_counts.tolist() == [1000, 1000, 1000]
        one = 1000 * 2 * math.pi / 4096 / 100
        assert axes.answers.position == pytest.approx([0.0, -one, one])
        # 50 permille of 2 N m behind a gear of 100
        assert axes.answers.torque_raw.tolist() == [50, 50, 50]
        assert axes.answers.torque_nm == pytest.approx([10.0, -10.0, 10.0])
        assert axes.answers.statusword.tolist() == [0x1027] * 3

    @pytest.mark.parametrize(
        ("word", "enabled", "fault"),
        [
            (0x1237, True, False),
            (0xFFB7 & ~0x0008, True, False),  # bits without a fault
            (0x0233, False, False),  # switched on
            (0x1217, False, False),  # stops by itself: quick stop active
            (0x021F, False, True),  # fault reaction active
            (0x0218, False, True),
        ],
    )
    def test_a_status_word_that_ends_the_motion_is_reported(
        self, bench: Any, word: int, enabled: bool, fault: bool
    ) -> None:
        axes = bench.enabled()
        bench.drives[1].status = lambda: word
        assert bench.cycle(STILL) is enabled
        assert axes.answers.enabled.tolist() == [True, enabled, True]
        assert axes.answers.fault.tolist() == [False, fault, False]
        assert axes.answers.statusword[1] == word

    def test_set_points_act_at_the_next_sync(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.cycle((0.5, 0.5, 0.0))
        assert axes.answers.position_counts[0] == 1000
        bench.cycle(STILL)
        assert axes.answers.position_counts[0] == 1000 + round(32595 * 0.008)
        bench.cycle(STILL)
        assert axes.answers.position[:2] == pytest.approx([0.004, 0.004 - 0.01534], abs=1e-5)

    def test_velocities_are_sent_in_the_drives_units(self, bench: Bench) -> None:
        bench.enabled()
        assert bench.cycle((1.0, 1.0, -1.0))
        assert bench.commands(1)[-1] == (0x000F, 65190)
        assert bench.commands(2)[-1] == (0x000F, -65190)
        assert bench.commands(3)[-1] == (0x000F, -9549)

    def test_a_missing_answer_is_flagged_and_the_others_are_used(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.cycle(STILL)
        bench.drives[1].answers_sync = False
        bench.drives[0].objects[0x6064, 0] = (2000).to_bytes(4, "little")
        before_s = bench.bus.now_s
        assert bench.cycle(STILL)
        assert axes.answers.received.tolist() == [True, False, True]
        assert axes.answers.position_counts.tolist() == [2000, 1000, 1000]
        assert bench.bus.now_s - before_s <= 0.008 + 0.6 * 0.008 + 1e-9

    def test_an_answer_of_the_wrong_length_is_not_used(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.drives[2].tpdo_bytes = 6
        bench.cycle(STILL)
        assert not axes.answers.received[2]
        (event,) = axes.take_events()
        assert event.kind is EventKind.WRONG_LENGTH
        assert event.kind.is_fault
        assert event.text == (
            "elbow: the drive sent a TPDO of 6 bytes, but 8 are mapped; the frame was not used"
        )

    def test_a_late_answer_is_not_used_for_the_next_cycle(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.drives[0].answers_sync = False
        late = Frame(0x181, struct.pack("<Hih", 0x1027, 77, 0))
        bench.arrives(late, 0.007)
        bench.cycle(STILL)
        assert not axes.answers.received[0]
        bench.cycle(STILL)
        assert not axes.answers.received[0]
        assert axes.answers.late_frames == 1
        assert axes.answers.position_counts[0] == 1000

    def test_unknown_identifiers_are_reported_once_and_counted(self, bench: Bench) -> None:
        axes = bench.enabled()
        for _ in range(5):
            bench.arrives(Frame(0x3AA, b"\x1b"), 50e-6)
            bench.cycle(STILL)
        (event,) = axes.take_events()
        assert event.kind is EventKind.UNEXPECTED_FRAME
        assert not event.kind.is_fault
        assert axes.watch.unexpected_frames == 5

    def test_another_master_during_a_motion_is_reported(self, bench: Bench) -> None:
        bench.enabled()
        bench.arrives(Frame(0x000, b"\x01\x00"), 50e-6)
        bench.cycle(STILL)
        assert kinds(bench) == [EventKind.FOREIGN_MASTER]


class TestEvents:
    def test_an_emergency_message_is_reported(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.drives[1].emergency(0x8611, 0x21)
        bench.cycle(STILL)
        (event,) = axes.take_events()
        assert (event.kind, event.joint, event.code) == (EventKind.EMERGENCY, "shoulder", 0x8611)
        assert event.text == (
            "shoulder: the drive reported: following error (EMCY 8611h, 1001h=21h)"
        )
        assert axes.take_events() == ()

    def test_a_cleared_emergency_is_not_a_fault(self, bench: Bench) -> None:
        axes = bench.enabled()
        bench.drives[1].emergency(0, 0)
        bench.cycle(STILL)
        (event,) = axes.take_events()
        assert event.kind is EventKind.EMERGENCY_CLEARED
        assert not event.kind.is_fault

    def test_a_flood_of_emergencies_needs_bounded_memory(self, bench: Bench) -> None:
        axes = bench.enabled()
        for _ in range(500):
            bench.drives[1].emergency(0x7121)
        bench.cycle(STILL)
        assert axes.answers.received.all()
        assert len(axes.take_events()) == 64

    def test_a_drive_that_boots_during_a_motion_is_reported(self, bench: Bench) -> None:
        bench.enabled()
        bench.arrives(heartbeat_frame(3, NmtState.INITIALISING), 0.0)
        bench.cycle(STILL)
        (event,) = bench.axes.take_events()
        assert (event.kind, event.joint) == (EventKind.BOOT_UP, "elbow")

    def test_a_lost_heartbeat_is_reported(self, bench: Bench) -> None:
        bench.enabled()
        bench.drives[2].beat_generation += 1
        stopped_s = bench.bus.now_s
        while not (events := bench.axes.take_events()):
            bench.cycle(STILL)
        assert [(e.kind, e.joint) for e in events] == [(EventKind.HEARTBEAT_LOST, "elbow")]
        assert bench.bus.now_s - stopped_s <= 0.1 + 2 * 0.008
        for _ in range(20):
            bench.cycle(STILL)
        assert bench.axes.take_events() == (), "a loss is reported once"

    def test_a_drive_that_leaves_operational_is_reported(self, bench: Bench) -> None:
        bench.enabled()
        bench.drives[0].nmt = NmtState.STOPPED
        found: list[EventKind] = []
        for _ in range(10):
            bench.cycle(STILL)
            found += kinds(bench)
        assert set(found) == {EventKind.NOT_OPERATIONAL}
