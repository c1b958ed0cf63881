"""Bring-up: order of the frames, settings that are read back, and drives that are refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from config.cell.cell import CellConfig, DeviceIdentity
from config.cell.servo_profile import ServoProfile
from config.errors import (
    ConfigError,
    DeviceTimeoutError,
    DriverError,
    LockedError,
    PreflightError,
    ProtocolError,
)
from config.robot.robot import RobotDescription
from drivers.canopen.emcy import Emergency, emcy_frame
from drivers.canopen.frames import SYNC, Frame
from drivers.canopen.heartbeat import heartbeat_frame
from drivers.canopen.nmt import NmtState
from drivers.ports.can_link import CanLink
from drivers.servo.axes import CanServoAxes
from drivers.servo.bring_up import check_bus_load
from drivers.servo.cia402 import PowerState
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


def test_nothing_is_sent_before_other_masters_are_excluded(bench: Bench) -> None:
    began_s = bench.bus.now_s
    bench.axes.bring_up()
    first_s, first = bench.bus.sent[0]
    assert first_s - began_s >= 0.08
    assert first == Frame(0x000, b"\x82\x01")


def test_every_drive_is_reset_separately_and_awaited(bench: Bench) -> None:
    bench.axes.bring_up()
    assert bench.bus.sent_to(0x000) == [b"\x82\x01", b"\x82\x02", b"\x82\x03"]


def test_the_order_of_writes_to_a_drive(bench: Bench) -> None:
    bench.axes.bring_up()
    written = [f"{index:04X}:{sub}={value:X}" for index, sub, value in bench.drives[0].writes]
    # 0.05 rad and 10 rad/s2 of a joint with 4096 increments and a gear of 100
    assert written == [
        "1017:0=32", "1016:1=7F0050", "1029:1=0", "6007:0=3", "605A:0=2", "605E:0=2",
        "6085:0=9F27B", "6065:0=CBB", "6066:0=14", "6072:0=BB8", "6060:0=9",
        "60C2:1=8", "60C2:2=FD", "1400:5=50",
        "1400:1=80000201", "1600:0=0", "1600:1=60400010", "1600:2=60FF0020",
        "1600:0=2", "1400:2=1", "1400:1=201",
        "1800:1=C0000181", "1A00:0=0", "1A00:1=60410010", "1A00:2=60640020", "1A00:3=60770010",
        "1A00:0=3", "1800:2=1", "1800:1=40000181",
        "1401:1=80000300", "1801:1=80000280",
    ]  # fmt: skip


def test_bring_up_sends_no_power_command_and_no_cyclic_frame(bench: Bench) -> None:
    bench.axes.bring_up()
    assert all(drive.state is PowerState.SWITCH_ON_DISABLED for drive in bench.drives)
    assert bench.bus.sent_to(0x080) == []
    assert bench.bus.sent_to(0x201) == []


def test_every_setting_is_read_back_and_listed(bench: Bench) -> None:
    bench.axes.bring_up()
    settings = bench.axes.settings()
    assert {s.node_id for s in settings} == {1, 2, 3}
    assert {s.verdict for s in settings} == {"ok", "shown"}
    watch = bench.found("1016h:01")
    assert (watch.joint, watch.required, watch.found) == ("base", "7F0050h", "7F0050h")
    assert bench.found("6007h:00").found == "3"
    assert bench.found("60C2h:02").found == "-3"
    assert bench.found("1000h:00").found == "402"
    assert bench.found("605Bh:00").found == "not in this drive"
    assert bench.found("1A00h:02").found == "60640020h"


def test_control_characters_in_a_device_name_are_escaped(bench: Bench) -> None:
    bench.axes.bring_up()
    assert bench.found("1008h:00").found == r"drive \x1b[31mred"


def test_axes_are_in_the_robots_order_for_any_order_in_the_cell_file(bench: Bench) -> None:
    bench.axes.bring_up()
    joints = {s.node_id: s.joint for s in bench.axes.settings()}
    assert joints == {1: "base", 2: "shoulder", 3: "elbow"}


class TestRefusals:
    @pytest.mark.parametrize(
        ("index", "subindex", "required"),
        [
            (0x1016, 1, "7F0050h"),
            (0x1017, 0, "50"),
            (0x6007, 0, "3"),
            (0x605E, 0, "2"),
            (0x6060, 0, "9"),
            (0x6065, 0, "3259"),
            (0x6072, 0, "3000"),
            (0x6085, 0, "651899"),
            (0x60C2, 1, "8"),
            (0x1400, 2, "1h"),
            (0x1600, 2, "60FF0020h"),
            (0x1A00, 2, "60640020h"),
            (0x1800, 1, "182h"),
            (0x1801, 1, "off"),
        ],
    )
    def test_an_ignored_write_is_refused(
        self, bench: Bench, index: int, subindex: int, required: str
    ) -> None:
        drive = bench.drives[1]
        drive.objects[0x605E, 0] = b"\x00\x00"
        drive.ignored = {(index, subindex)}
        if index == 0x1800:
            drive.objects[index, subindex] = b"\x82\x01\x00\x80"
        setting = f"{index:04X}h:{subindex:02X}"
        names = ("shoulder (node 2): ", setting, f"required: {required}")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", *names):
            bench.axes.bring_up()
        (red,) = [s for s in bench.axes.settings() if s.verdict == "red" and s.required == required]
        assert (red.joint, red.object_name) == ("shoulder", setting)

    @pytest.mark.fault(18)
    def test_a_drive_without_heartbeat_consumer_is_refused(
        self, bench: Bench, measured: Callable[[str], None]
    ) -> None:
        """A drive without 1016h would continue to run after a crash of this computer."""
        del bench.drives[2].objects[0x1016, 1]
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "1016h:01"):
            bench.axes.bring_up()
        with raises_code(DriverError, "RID-INTERNAL-ERROR", "bring_up"):
            bench.axes.start()
        with raises_code(DriverError, "RID-INTERNAL-ERROR"):
            bench.axes.enable()
        measured("a drive without 1016h: cannot be started, cannot be enabled")

    def test_a_drive_without_heartbeat_consumer_is_accepted_if_the_cell_file_allows_it(
        self, make_bench: Callable[[CellConfig], Any], cell: CellConfig
    ) -> None:
        safety = cell.drive_safety.model_copy(update={"allow_drive_without_watchdog": (3,)})
        bench = make_bench(cell.model_copy(update={"drive_safety": safety}))
        del bench.drives[2].objects[0x1016, 1]
        bench.drives[2].ignored = {(0x6007, 0)}
        bench.axes.bring_up()
        assert bench.found("1016h:01", 3).verdict == "allowed"
        assert bench.found("6007h:00", 3).verdict == "allowed"

    def test_the_exception_applies_to_that_drive_alone(
        self, make_bench: Callable[[CellConfig], Any], cell: CellConfig
    ) -> None:
        safety = cell.drive_safety.model_copy(update={"allow_drive_without_watchdog": (3,)})
        bench = make_bench(cell.model_copy(update={"drive_safety": safety}))
        bench.drives[0].ignored = {(0x6007, 0)}
        with raises_code(PreflightError, "RID-PREFLIGHT-RED"):
            bench.axes.bring_up()

    def test_one_run_reports_every_error(self, bench: Bench) -> None:
        bench.drives[0].ignored = {(0x6007, 0), (0x1017, 0)}
        bench.drives[2].ignored = {(0x6060, 0)}
        with pytest.raises(PreflightError) as caught:
            bench.axes.bring_up()
        for part in (
            "6007h:00 is 0, required: 3",
            "1017h:00",
            "elbow (node 3)",
            "Nothing is moved",
        ):
            assert part in str(caught.value)
        assert [s.verdict for s in bench.axes.settings()].count("red") == 3

    def test_a_refused_write_is_reported_with_its_reason(self, bench: Bench) -> None:
        bench.drives[0].objects[0x6072, 0] = bytes(4)
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "refused"):
            bench.axes.bring_up()

    def test_a_gear_that_differs_from_the_robot_file_is_refused(self, bench: Bench) -> None:
        bench.drives[0].objects[0x6091, 1] = (101).to_bytes(4, "little")
        with raises_code(
            PreflightError, "RID-PREFLIGHT-RED", "6091h:00", "101:1", "required", "100"
        ):
            bench.axes.bring_up()

    def test_a_drive_without_gear_object_is_accepted(self, bench: Bench) -> None:
        bench.drives[0].objects[0x6091, 1] = (1).to_bytes(4, "little")
        bench.axes.bring_up()
        assert bench.found("6091h:00").verdict == "shown"
        assert bench.found("6065h:00").found == "3259", "the robot file's gear is used"

    @pytest.mark.parametrize(("part", "value"), [(2, 0), (1, 100)])
    def test_an_impossible_encoder_is_refused(self, bench: Bench, part: int, value: int) -> None:
        bench.drives[0].objects[0x608F, part] = value.to_bytes(4, "little")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", f"608Fh:0{part}", str(value)):
            bench.axes.bring_up()

    def test_a_drive_without_cyclic_synchronous_velocity_is_refused(self, bench: Bench) -> None:
        bench.drives[0].objects[0x6502, 0] = (0x2ED).to_bytes(4, "little")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "6502h:00", "0h", "required", "100h"):
            bench.axes.bring_up()

    def test_a_device_that_is_not_a_drive_is_refused(self, bench: Bench) -> None:
        bench.drives[0].objects[0x1000, 0] = (0x191).to_bytes(4, "little")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED"):
            bench.axes.bring_up()

    def test_a_drive_that_sends_sync_is_refused(self, bench: Bench) -> None:
        bench.drives[0].objects[0x1005, 0] = (0x4000_0080).to_bytes(4, "little")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED"):
            bench.axes.bring_up()

    def test_a_drive_in_fault_is_named_and_not_reset(self, bench: Bench) -> None:
        bench.drives[0].state = PowerState.FAULT
        bench.drives[0].objects[0x603F, 0] = (0x7305).to_bytes(2, "little")
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "base", "fault", "7305h"):
            bench.axes.bring_up()
        assert bench.drives[0].state is PowerState.FAULT


class TestMissingDevices:
    def test_a_drive_that_does_not_boot_is_reported(self, bench: Bench) -> None:
        bench.drives[1].mute = True
        with raises_code(DeviceTimeoutError, "RID-DRIVE-SILENT"):
            bench.axes.bring_up()
        assert bench.bus.sent_to(0x601) == [], "another drive got a request"

    def test_a_drive_that_becomes_silent_is_reported(self, bench: Bench) -> None:
        drive = bench.drives[1]
        write = drive.server._write

        def die(index: int, subindex: int, data: bytes) -> None:
            drive.mute = True
            write(index, subindex, data)

        drive.server._write = die
        with raises_code(DeviceTimeoutError, "RID-DRIVE-SILENT"):
            bench.axes.bring_up()
        assert {s.node_id for s in bench.axes.settings()} == {1}

    def test_two_devices_with_one_node_id_are_refused(self, bench: Bench) -> None:
        bench.drives[2].boots = 2
        with raises_code(ProtocolError, "RID-DRIVE-NODE-TWICE"):
            bench.axes.bring_up()

    @pytest.mark.parametrize(
        ("frame", "what"),
        [
            (SYNC, ("SYNC",)),
            (Frame(0x000, b"\x01\x00"), ("NMT",)),
            (heartbeat_frame(127, NmtState.OPERATIONAL), ("node 127", "heartbeat")),
            (Frame(0x602, bytes(8)), ("SDO", "node 2")),
            (Frame(0x203, bytes(8)), ("commands", "node 3")),
            (Frame(0x655, bytes(8)), ("SDO", "node 85")),
            (Frame(0x7E5, bytes(8)), ("LSS",)),
        ],
    )
    def test_another_master_is_refused(
        self, bench: Bench, frame: Frame, what: tuple[str, ...]
    ) -> None:
        bench.bus.transmit(frame, 0.05)
        with raises_code(LockedError, "RID-CAN-FOREIGN-MASTER", *what):
            bench.axes.bring_up()
        assert bench.bus.sent == []

    @pytest.mark.parametrize("delay_s", [0.082, 0.095, 0.108, 0.112])
    def test_another_master_during_bring_up_is_refused(self, bench: Bench, delay_s: float) -> None:
        bench.bus.transmit(Frame(0x602, bytes(8)), delay_s)
        with raises_code(LockedError, "RID-CAN-FOREIGN-MASTER"):
            bench.axes.bring_up()
        assert bench.bus.sent != []
        assert bench.bus.sent_to(0x201) == []

    def test_other_devices_on_the_bus_are_tolerated(self, bench: Bench) -> None:
        for delay_s in (0.02, 0.1, 0.2):
            bench.bus.transmit(heartbeat_frame(55, NmtState.OPERATIONAL), delay_s)
            bench.bus.transmit(emcy_frame(55, Emergency(0x1000, 1)), delay_s)
            bench.bus.transmit(Frame(0x582, bytes(8)), delay_s)
        bench.axes.bring_up()
        assert all(drive.state is PowerState.SWITCH_ON_DISABLED for drive in bench.drives)
        assert {setting.verdict for setting in bench.axes.settings()} == {"ok", "shown"}


class TestConfiguration:
    def test_cell_and_robot_must_name_the_same_joints(
        self, cell: CellConfig, robot: RobotDescription, bench: Bench
    ) -> None:
        axes = (*cell.axes[:2], cell.axes[2].model_copy(update={"joint": "wrist"}))
        with raises_code(ConfigError, "RID-CELL-JOINTS", "drive", "joints"):
            CanServoAxes(bench.link, cell.model_copy(update={"axes": axes}), robot)

    def test_a_bus_load_above_the_limit_is_refused(self, cell: CellConfig) -> None:
        fast = cell.model_copy(update={"cycle_time_ms": 1})
        assert check_bus_load(fast) == pytest.approx(0.715, abs=0.001)
        slow_bus = fast.can.model_copy(update={"bitrate": 500_000})
        with raises_code(ConfigError, "RID-CAN-LOAD", "143"):
            check_bus_load(fast.model_copy(update={"can": slow_bus}))

    def test_the_constructor_sends_nothing(
        self, cell: CellConfig, robot: RobotDescription, bench: Bench
    ) -> None:
        CanServoAxes(CanLink(bench.bus), cell, robot)
        assert bench.bus.sent == []


class TestDriveIdentity:
    """Object 1018h of the drive has vendor 1234h and revision 20005h, and no product code."""

    def bring_up(
        self, make_bench: Callable[[CellConfig], Any], cell: CellConfig, **identity: int
    ) -> Any:
        axis = cell.axes[1].model_copy(update={"identity": DeviceIdentity(**identity)})
        bench = make_bench(cell.model_copy(update={"axes": (cell.axes[0], axis, cell.axes[2])}))
        bench.drive = bench.drives[axis.node_id - 1]
        bench.drive.objects[0x1018, 3] = (0x0002_0005).to_bytes(4, "little")
        return bench

    def test_the_expected_drive_is_accepted(
        self, make_bench: Callable[[CellConfig], Any], cell: CellConfig
    ) -> None:
        bench = self.bring_up(make_bench, cell, vendor=0x1234, revision=0x0002_0000)
        bench.axes.bring_up()
        own = [s for s in bench.axes.settings() if s.node_id == bench.drive.node_id]
        verdicts = {
            s.name: (s.required, s.found, s.verdict) for s in own if "1018h" in s.object_name
        }
        assert verdicts["vendor"] == ("1234h", "1234h", "ok")
        assert verdicts["product"] == ("", "not in this drive", "shown")
        assert verdicts["revision"] == ("", "20005h", "shown")
        assert verdicts["revision, upper 16 bits"] == ("20000h", "20000h", "ok")

    @pytest.mark.parametrize(
        ("identity", "details"),
        [
            ({"vendor": 0x1235}, ("1018h:01", "1234h", "required: 1235h")),
            ({"vendor": 0x1234, "product": 7}, ("1018h:02", "required: 7h")),
            ({"revision": 0x0001_0005}, ("1018h:03", "20000h", "required: 10000h")),
        ],
    )
    def test_another_drive_gets_no_write(
        self,
        make_bench: Callable[[CellConfig], Any],
        cell: CellConfig,
        identity: dict[str, int],
        details: tuple[str, ...],
    ) -> None:
        bench = self.bring_up(make_bench, cell, **identity)
        node = f"(node {bench.drive.node_id}): "
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", node, *details):
            bench.axes.bring_up()
        assert bench.drive.writes == []
        assert all(drive.writes for drive in bench.drives if drive is not bench.drive)
        with raises_code(DriverError, "RID-INTERNAL-ERROR", "bring_up"):
            bench.axes.start()


@pytest.mark.parametrize(("written", "red"), [(True, True), (False, False)])
def test_a_drive_without_60c2h_is_accepted_if_the_cell_file_allows_it(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig, written: bool, red: bool
) -> None:
    servo = ServoProfile(cycle_time_written=written)
    bench = make_bench(cell.model_copy(update={"servo": servo}))
    for sub in (1, 2):
        del bench.drives[0].objects[0x60C2, sub]
    if red:
        with pytest.raises(PreflightError):
            bench.axes.bring_up()
    else:
        for drive in bench.drives[1:]:
            drive.objects[0x60C2, 1] = bytes([int(cell.cycle_time_ms)])
        bench.axes.bring_up()
    assert bench.found("60C2h:01").verdict == ("red" if red else "shown")


def test_a_fixed_period_of_a_drive_must_equal_the_cells_cycle_time(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> None:
    bench = make_bench(cell.model_copy(update={"servo": ServoProfile(cycle_time_written=False)}))
    for drive in bench.drives[:2]:
        drive.objects[0x60C2, 1] = bytes([int(cell.cycle_time_ms)])
    with pytest.raises(PreflightError):
        bench.axes.bring_up()
    verdicts = [bench.found("60C2h:01", node_id=node).verdict for node in (1, 2, 3)]
    assert verdicts == ["ok", "ok", "red"]


def test_a_cycle_time_in_parts_of_a_millisecond_is_written_as_tenths(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> None:
    bench = make_bench(cell.model_copy(update={"cycle_time_ms": 6.7}))
    bench.axes.bring_up()
    for drive in bench.drives:
        assert drive.objects[0x60C2, 1] == bytes([67])
        assert drive.objects[0x60C2, 2] == (-4).to_bytes(signed=True)
