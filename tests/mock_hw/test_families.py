"""Drive families that deviate from the standard: bring-up, motion, stop, watchdog test."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from config.cell.cell import CanBusConfig, CellConfig, DriveAxis
from config.cell.drive_safety import DriveSafety
from config.cell.servo_profile import Mode, ServoProfile, TorqueObject
from config.errors import DeviceFaultError, PreflightError
from config.formats.eds import parse_eds
from config.load import bundled_names, load_bundled_or_path
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from drivers.canopen.frames import Frame
from drivers.cell import Cell
from drivers.data_sheets.eds_check import eds_findings
from drivers.interfaces.servo_axes import EventKind
from drivers.ports.can_link import CanLink
from drivers.servo.drive_settings import restore_drive
from drivers.servo.sdo_port import SdoPort
from drivers.servo.watchdog_test import WatchdogResult, require_watchdogs, run_watchdog_test
from drivers.settings.write_log import WriteLog, read_write_log
from mock_hw.drive import objects as od
from mock_hw.drive.drive import SimulatedDrive
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.objects import SimulatedIdentity
from tests.builders.obedient_cell import ObedientCell
from tests.builders.raised_codes import raises_code

INCREMENTS = 4096
NAMES = ("base", "elbow")


def robot() -> RobotDescription:
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=2.0, acceleration=10.0, torque=300.0
    )
    return RobotDescription(
        name="two",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(a_m=0.1),) * 2),
        joints=tuple(Joint(name=name, limits=limits, gear_ratio=100.0) for name in NAMES),
    )


def cell_of(*profiles: ServoProfile, **safety: object) -> CellConfig:
    limits = {"quick_stop_deceleration_rad_s2": 20.0, "following_error_rad": 0.3}
    return CellConfig(
        name="families",
        robot="two",
        cycle_time_ms=4,
        can=CanBusConfig(interface="virtual", channel="families"),
        axes=tuple(
            DriveAxis(joint=name, node_id=node, servo=profile)
            for node, (name, profile) in enumerate(zip(NAMES, profiles, strict=True), start=1)
        ),
        position_gain_per_s=10.0,
        drive_safety=DriveSafety.model_validate(limits | safety),
    )


@contextmanager
def opened(cell: CellConfig) -> Iterator[tuple[Cell, ObedientCell]]:
    bus = ObedientCell(cell, robot(), INCREMENTS)
    with Cell(cell, robot(), CanLink(bus)) as open_cell:
        yield open_cell, bus


def try_all_watches(cell: CellConfig) -> tuple[WatchdogResult, ...]:
    with opened(cell) as (open_cell, _):
        return run_watchdog_test(open_cell.axes, open_cell.clock, cell)


def move_both_axes(cell: CellConfig) -> None:
    """Move both axes back and forth, and stop during the motion."""
    with opened(cell) as (open_cell, bus):
        axes, clock = open_cell.axes, open_cell.clock
        axes.bring_up()
        axes.start()
        due_s = axes.enable()
        start = axes.answers.position.copy()
        target, moved = start.copy(), []
        for cycle in range(100):
            clock.sleep_until(due_s := due_s + cell.cycle_time_s)
            axes.exchange()
            velocity = np.array([0.5, -0.3]) * math.sin(math.pi * min(1.0, cycle / 75))
            moved.append(axes.answers.position - target)
            target += velocity * cell.cycle_time_s
            assert axes.command(velocity)
            axes.send_heartbeat(clock.now_s())
        assert np.abs(moved).max() < 0.01
        assert axes.answers.position - start == pytest.approx([0.095, -0.057], abs=0.003)
        assert axes.halt()
        assert not any(drive.power.following for drive in bus.drives)
        assert axes.disable() == ()


def make_report_only(drive: SimulatedDrive) -> None:
    """Make a drive send 8130h when this computer is silent, but continue to move."""
    drive.objects[od.ABORT_CONNECTION] = 0
    drive.objects[od.COMMUNICATION_ERROR] = 1
    drive.objects.store()


WITHOUT_REACTIONS = ServoProfile(lacks=("6007h", "605Ah", "605Eh", "1029h"))


def test_a_drive_without_reaction_objects_is_tested_for_its_stop() -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    trials = try_all_watches(cell)
    assert all(trial.powered for trial in trials), (
        "a drive that only sends an emergency message has not stopped"
    )
    assert all(trial.reacted_s <= 0.088 for trial in trials)
    assert [trial.how for trial in trials] == ["fault", "switch on disabled"]
    move_both_axes(cell)


def test_the_watchdog_test_runs_before_a_motion_without_a_request() -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        assert open_cell.axes.undefined_reactions == ("base",)
        require_watchdogs(open_cell.axes, open_cell.clock, cell)
        assert any(any(powered) for _, _, _, powered in bus.trace)
        open_cell.axes.start()
        open_cell.axes.enable()


def test_a_drive_with_known_reactions_is_not_powered_for_a_test() -> None:
    cell = cell_of(ServoProfile(), ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        require_watchdogs(open_cell.axes, open_cell.clock, cell)
        assert bus.trace == []


def test_a_drive_that_does_not_stop_without_this_computer_is_never_moved() -> None:
    cell = cell_of(ServoProfile(), WITHOUT_REACTIONS)
    with opened(cell) as (open_cell, bus):
        bus.drives[1].objects[od.ABORT_CONNECTION] = 0
        open_cell.axes.bring_up()
        with raises_code(PreflightError, "RID-DRIVE-WATCHDOG", "time"):
            require_watchdogs(open_cell.axes, open_cell.clock, cell)
        trial = run_watchdog_test(open_cell.axes, open_cell.clock, cell)[1]
        assert (trial.joint, trial.how) == ("elbow", "operation enabled")
        assert math.isnan(trial.reacted_s)


@pytest.mark.parametrize("rate", [0.98, 1.0, 1.02, 1.1])
@pytest.mark.parametrize("commands", ["at_sync", "on_arrival"])
def test_a_drive_that_only_reports_the_silent_computer_is_never_moved(
    commands: str, rate: float
) -> None:
    """The drive continues its cyclic exchange.

    Its fault message can arrive before the other drives stop.
    """
    cell = cell_of(ServoProfile(), WITHOUT_REACTIONS.model_copy(update={"commands": commands}))
    with opened(cell) as (open_cell, bus):
        make_report_only(bus.drives[1])
        bus.drives[1].clock.rate = rate
        open_cell.axes.bring_up()
        with raises_code(PreflightError, "RID-DRIVE-WATCHDOG", "time"):
            require_watchdogs(open_cell.axes, open_cell.clock, cell)
        base, elbow = run_watchdog_test(open_cell.axes, open_cell.clock, cell)
        assert (elbow.how, math.isnan(elbow.reacted_s)) == ("operation enabled", True)
        assert base.reacted_s <= 0.088


@pytest.mark.parametrize("late_s", [0.0, 0.06])
def test_the_reaction_time_is_that_of_the_stop_and_not_of_the_report(
    late_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = cell_of(ServoProfile(), WITHOUT_REACTIONS)
    with opened(cell) as (open_cell, bus):
        drive, axes, reports_s = bus.drives[1], open_cell.axes, list[float]()
        make_report_only(drive)
        lose_master, exchange = drive._lose_master, axes.exchange

        def reported(code: int) -> None:
            if drive.power.following:
                reports_s.append(bus.now_s)
            lose_master(code)

        def exchanged() -> float:
            if reports_s and bus.now_s >= reports_s[0] + late_s:
                drive._fault(0x8130)
            return exchange()

        monkeypatch.setattr(drive, "_lose_master", reported)
        monkeypatch.setattr(axes, "exchange", exchanged)
        trial = run_watchdog_test(axes, open_cell.clock, cell)[1]
        assert trial.how == "fault"
        assert trial.reacted_s - 0.08 - late_s <= 2 * cell.cycle_time_s
        assert trial.reacted_s >= 0.08 + late_s


GUARDED = ServoProfile(
    watch="life_guarding", lacks=("1016h", "1017h", "1029h", "1400h:05", "6007h", "605Ah", "605Eh")
)


@pytest.mark.fault(18)
def test_a_drive_with_life_guarding_instead_of_heartbeats_is_moved(
    measured: Callable[[str], None],
) -> None:
    cell = cell_of(GUARDED, ServoProfile())
    move_both_axes(cell)
    trials = try_all_watches(cell)
    assert all(trial.reacted_s <= 0.088 for trial in trials), trials
    assert all(trial.detected_s <= 0.108 for trial in trials), trials
    assert trials[0].how == "fault"
    measured(
        f"life guarding: stop {1e3 * trials[0].reacted_s:.0f} ms after the last guarding request"
    )


def test_life_guarding_is_tested_before_every_motion() -> None:
    cell = cell_of(ServoProfile(watch="life_guarding", lacks=("1016h",)), ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        assert open_cell.axes.undefined_reactions == ("base",)
        assert bus.drives[0].objects[od.HEARTBEAT_PRODUCER] == 0
        assert bus.drives[0].objects[od.GUARD_TIME] == 25
        assert bus.drives[0].objects[od.LIFE_TIME_FACTOR] == 3
        bus.drives[0].watches = False
        with raises_code(PreflightError, "RID-DRIVE-WATCHDOG", "time"):
            require_watchdogs(open_cell.axes, open_cell.clock, cell)


def test_the_watchdog_test_of_a_guarded_drive_with_a_fault_is_completed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cell = cell_of(GUARDED, ServoProfile())
    with opened(cell) as (open_cell, bus):
        drive = bus.drives[0]
        monkeypatch.setattr(drive, "_lose_master", drive._fault)
        trials = run_watchdog_test(open_cell.axes, open_cell.clock, cell)
        assert all(trial.reacted_s <= 0.088 and trial.detected_s <= 0.108 for trial in trials)

        def fail_otherwise(code: int) -> None:
            drive._fault(code)
            drive._fault(0x3210)

        monkeypatch.setattr(drive, "_lose_master", fail_otherwise)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "3210h"):
            run_watchdog_test(open_cell.axes, open_cell.clock, cell)


@pytest.mark.parametrize("lacking", ["100Ch", "100Dh"])
def test_a_drive_without_any_watchdog_is_refused(lacking: str) -> None:
    other = ServoProfile(watch="life_guarding", lacks=("1016h", lacking))
    with (
        opened(cell_of(other, ServoProfile())) as (open_cell, _),
        raises_code(PreflightError, "RID-PREFLIGHT-RED", "(node 1)", f"{lacking}:00"),
    ):
        open_cell.axes.bring_up()


@pytest.mark.parametrize("stale", [False, True])
def test_a_guarded_drive_that_no_longer_answers_is_detected(stale: bool) -> None:
    """If `stale`, the drive repeats its last answer, as a controller whose program hangs."""
    cell = cell_of(GUARDED, ServoProfile())
    with opened(cell) as (open_cell, bus):
        axes, clock = open_cell.axes, open_cell.clock
        axes.bring_up()
        axes.start()
        due_s = axes.enable()
        bus.drives[0].beats = False
        since_s, detected_s = clock.now_s(), math.inf
        while clock.now_s() < since_s + 0.3 and math.isinf(detected_s):
            clock.sleep_until(due_s := due_s + cell.cycle_time_s)
            axes.exchange()
            if stale:
                axes.watch.handle(Frame(0x701, b"\x85"), clock.now_s())
            axes.command(np.zeros(2))
            axes.send_heartbeat(clock.now_s())
            lost = [e for e in axes.take_events() if e.kind is EventKind.HEARTBEAT_LOST]
            detected_s = min((event.time_s for event in lost), default=math.inf)
        assert detected_s - since_s <= 0.14


def test_a_drive_with_profile_velocity_current_and_vendor_units_is_moved() -> None:
    other = ServoProfile(
        mode="profile_velocity",
        encoder_increments=INCREMENTS,
        velocity_unit="rpm",
        velocity_units=1000.0,
        acceleration_unit="rpm",
        torque=TorqueObject(object="6078h:00", of="rated_current"),
        torque_limit=TorqueObject(object="6073h:00", of="rated_current"),
        torque_constant_nm_per_a=0.2,
        lacks=("608Fh", "6072h", "6076h", "6077h", "60B2h", "60C2h", "6066h"),
    )
    cell = cell_of(other, ServoProfile())
    move_both_axes(cell)
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        joint_nm = 100.0 * 1e-3 * bus.drives[0].objects[0x6075, 0] * 0.2
        bus.axes[0].torque = 500
        open_cell.axes.start()
        open_cell.axes.exchange()
        assert open_cell.axes.answers.torque_nm[0] == pytest.approx(0.5 * joint_nm, rel=1e-3)


@pytest.mark.parametrize("mode", ["cyclic_position", "interpolated_position"])
def test_a_drive_with_position_mode_only_is_moved(mode: Mode) -> None:
    other = ServoProfile(
        mode=mode,
        encoder_increments=INCREMENTS,
        rated_torque_nm=1.0,
        torque_limit=None,
        deceleration_rad_s2=20.0,
        lacks=("60FFh", "6007h", "605Ah", "605Eh", "6066h", "6072h", "6076h", "6085h", "608Fh"),
    )
    move_both_axes(cell_of(other, ServoProfile()))
    trials = try_all_watches(cell_of(other, ServoProfile()))
    assert all(trial.reacted_s <= 0.088 for trial in trials)


def test_enabling_moves_no_position_mode_axis() -> None:
    cell = cell_of(ServoProfile(mode="cyclic_position"), ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        open_cell.axes.start()
        bus.axes[0].counts += 12345.0  # moved by hand, before the axis has power
        open_cell.axes.enable()
        stood = bus.axes[0].counts
        for _ in range(20):
            open_cell.axes.exchange()
            open_cell.clock.sleep_until(open_cell.clock.now_s() + cell.cycle_time_s)
            assert open_cell.axes.command(np.zeros(2))
            open_cell.axes.send_heartbeat(open_cell.clock.now_s())
        assert abs(bus.axes[0].counts - stood) < 2


def bundled(name: str) -> ServoProfile:
    """Return a bundled servo profile, completed with values that its drives do not provide."""
    profile = load_bundled_or_path(name, "servos", ServoProfile)
    values: dict[str, float] = {}
    if profile.encoder_increments is None:
        values["encoder_increments"] = INCREMENTS
    if profile.torque.of == "rated_torque" and "6076h" in profile.lacks:
        values["rated_torque_nm"] = 1.0
    if profile.torque.of != "rated_torque":
        values["torque_constant_nm_per_a"] = 0.3
    return ServoProfile.model_validate(values).on(profile)


@pytest.mark.parametrize("name", bundled_names("servos"))
class TestBundledFamilies:
    def test_a_bundled_drive_is_brought_up_moved_and_stopped(self, name: str) -> None:
        move_both_axes(cell_of(bundled(name), ServoProfile()))

    def test_a_bundled_drive_has_watchdogs_that_act(self, name: str) -> None:
        trials = try_all_watches(
            cell_of(bundled(name), ServoProfile(), trip_watchdog_with_power=True)
        )
        assert all(trial.reacted_s <= 0.088 for trial in trials), trials
        assert all(trial.detected_s <= 0.108 for trial in trials), trials

    def test_a_bundled_drive_lacks_nothing_that_it_needs(self, name: str) -> None:
        cell = cell_of(bundled(name), ServoProfile())
        identity = SimulatedIdentity(
            1, INCREMENTS, Fraction(100), 1000, cell.servo_of(cell.axes[0])
        )
        sheet = parse_eds(drive_eds(identity, "d.eds", datetime(2026, 1, 2)).encode(), "d.eds")
        assert [f for f in eds_findings(sheet, cell, cell.axes[0]) if f.verdict == "red"] == []


def test_objects_that_a_family_lacks_are_neither_written_nor_restored(tmp_path: Path) -> None:
    cell = cell_of(GUARDED, ServoProfile())
    bus = ObedientCell(cell, robot(), INCREMENTS)
    link, log = CanLink(bus), WriteLog(tmp_path / "writes.jsonl", durable=False)
    windows = [drive.objects[od.FOLLOWING_ERROR_WINDOW] for drive in bus.drives]
    with Cell(cell, robot(), link, log) as open_cell:
        open_cell.axes.bring_up()
        assert [drive.objects[od.FOLLOWING_ERROR_WINDOW] for drive in bus.drives] != windows
        for saved in read_write_log(log.path):
            port = SdoPort(link, saved.node_id, lambda frame, now_s: None)
            restored = restore_drive(port, saved, dry_run=False)
            assert [each.name for each in restored if not each.restored] == []
        assert [drive.objects[od.FOLLOWING_ERROR_WINDOW] for drive in bus.drives] == windows
