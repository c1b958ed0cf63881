"""Watchdogs of the simulated drive: what they detect, and how the axis then comes to rest.

Without a configured watchdog the axis keeps moving.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from drivers.canopen.emcy import parse_emcy
from drivers.canopen.frames import Frame
from drivers.servo.cia402 import PowerState
from mock_hw.drive.power_stage import PowerStage

Bench = Any
SPEED = 100_000
DECELERATION = 1_000_000
RAMP_S = SPEED / DECELERATION


def emergencies(bench: Bench) -> list[tuple[float, int]]:
    return [(time_s, parse_emcy(frame.data).code) for time_s, frame in bench.take(0x083)]


def power(bench: Bench) -> PowerStage:
    stage = bench.drive.power
    assert isinstance(stage, PowerStage)
    return stage


def start_motion(bench: Bench, **watchdogs: int) -> None:
    bench.configure(quick_stop_deceleration=DECELERATION, **watchdogs)
    bench.enable(SPEED)
    assert power(bench).state is PowerState.OPERATION_ENABLED
    assert bench.axis.rate == SPEED
    bench.take()


def assert_quick_stop_then_off(bench: Bench, since_s: float) -> None:
    """Require that the axis brakes from `since_s` on, and that power is then off."""
    assert power(bench).state is PowerState.QUICK_STOP_ACTIVE
    bench.run_to(since_s + 0.5 * RAMP_S)
    assert bench.axis.rate == pytest.approx(0.5 * SPEED, rel=0.02)
    bench.run_to(since_s + RAMP_S - 1e-4)
    assert power(bench).powered
    bench.run_to(since_s + RAMP_S + 1e-4)
    assert power(bench).state is PowerState.SWITCH_ON_DISABLED
    assert not power(bench).powered
    assert bench.axis.rate == 0.0


@pytest.mark.fault(18)
def test_a_silent_master_causes_a_quick_stop(bench: Bench, measured: Callable[[str], None]) -> None:
    start_motion(bench, heartbeat_ms=80)
    last_beat_s = bench.now_s - 0.008
    bench.run_to(last_beat_s + 0.0799)
    assert bench.axis.rate == SPEED
    bench.run_to(last_beat_s + 0.0801)
    ((time_s, code),) = emergencies(bench)
    assert code == 0x8130
    assert time_s == pytest.approx(last_beat_s + 0.080)
    assert_quick_stop_then_off(bench, time_s)
    assert bench.read(0x1001) == 0x11
    assert bench.read(0x603F) == 0x8130
    assert bench.read(0x1003, 1) == 0x8130
    measured("quick stop 80 ms after the last heartbeat, at rest one ramp later")


def test_a_returning_master_clears_the_error_but_enables_nothing(bench: Bench) -> None:
    start_motion(bench, heartbeat_ms=80)
    bench.run_for(0.5)
    bench.take()
    bench.receive(Frame(0x77F, b"\x05"))
    assert [code for _, code in emergencies(bench)] == [0]
    assert bench.read(0x1001) == 0
    bench.receive(Frame(0, b"\x01\x00"))
    for _ in range(3):
        bench.cycle(0x000F, SPEED)
    assert power(bench).state is PowerState.SWITCH_ON_DISABLED
    assert bench.axis.rate == 0.0


def test_monitoring_starts_with_the_first_heartbeat(bench: Bench) -> None:
    bench.configure(heartbeat_ms=80)
    bench.take()
    bench.run_for(10.0)
    assert emergencies(bench) == []


def test_heartbeats_of_other_nodes_do_not_count(bench: Bench) -> None:
    start_motion(bench, heartbeat_ms=80)
    for _ in range(20):
        bench.run_for(0.008)
        bench.receive(Frame(0x70A, b"\x05"))
    assert [code for _, code in emergencies(bench)] == [0x8130]


@pytest.mark.parametrize(
    ("reaction", "state", "powered"),
    [
        (0, PowerState.OPERATION_ENABLED, True),
        (1, PowerState.FAULT_REACTION_ACTIVE, True),
        (2, PowerState.SWITCH_ON_DISABLED, False),
        (3, PowerState.QUICK_STOP_ACTIVE, True),
    ],
)
def test_a_lost_connection_causes_the_reaction_in_6007(
    bench: Bench, reaction: int, state: PowerState, powered: bool
) -> None:
    start_motion(bench, heartbeat_ms=80, abort_connection=reaction)
    bench.run_for(0.075)
    assert power(bench).state is state
    assert power(bench).powered is powered


def test_without_a_heartbeat_consumer_the_axis_continues_to_move(bench: Bench) -> None:
    """If the master is silent, only object 1016h or another watchdog stops the axis."""
    start_motion(bench)
    bench.run_for(10.0)
    assert bench.axis.rate == SPEED


@pytest.mark.parametrize(("reaction", "state"), [(0, 0x7F), (1, 0x05), (2, 0x04)])
def test_a_lost_master_changes_the_nmt_state_according_to_1029(
    bench: Bench, reaction: int, state: int
) -> None:
    bench.configure(heartbeat_ms=80)
    bench.write(0x1029, 1, reaction, 1)
    bench.cycle(0x0000)
    bench.run_for(0.1)
    assert bench.drive.nmt == state


def test_sync_loss_is_a_fault_after_one_and_a_half_periods(bench: Bench) -> None:
    start_motion(bench, sync_us=8000)
    last_sync_s = bench.now_s - 0.008
    bench.run_for(0.01)
    ((time_s, code),) = emergencies(bench)
    assert code == 0x8700
    assert time_s == pytest.approx(last_sync_s + 0.012)
    assert power(bench).state is PowerState.FAULT_REACTION_ACTIVE
    bench.run_for(RAMP_S + 0.001)
    assert power(bench).state is PowerState.FAULT
    assert bench.axis.rate == 0.0


def test_overdue_commands_count_as_a_lost_master(bench: Bench) -> None:
    start_motion(bench, rpdo_ms=20)
    last_rpdo_s = bench.now_s - 0.008
    for _ in range(3):
        bench.receive(Frame(0x80, b""))
        bench.run_for(0.008)
    ((time_s, code),) = emergencies(bench)
    assert code == 0x8250
    assert time_s == pytest.approx(last_rpdo_s + 0.020)
    bench.run_for(RAMP_S)
    assert power(bench).state is PowerState.SWITCH_ON_DISABLED


@pytest.mark.parametrize("command", [0x80, 0x02])
def test_leaving_operational_counts_as_a_lost_master(bench: Bench, command: int) -> None:
    start_motion(bench)
    bench.receive(Frame(0, bytes((command, 0))))
    assert_quick_stop_then_off(bench, bench.now_s)


@pytest.mark.parametrize("command", [0x81, 0x82])
def test_a_reset_removes_power(bench: Bench, command: int) -> None:
    start_motion(bench)
    bench.receive(Frame(0, bytes((command, 0))))
    assert not power(bench).powered
    bench.run_for(0.001)
    assert bench.axis.rate == 0.0


def test_a_blocked_axis_causes_a_following_error(bench: Bench) -> None:
    bench.configure(quick_stop_deceleration=DECELERATION)
    assert bench.write(0x6065, 0, 2000, 4) == 0
    assert bench.write(0x6066, 0, 20, 2) == 0
    bench.enable(SPEED)
    bench.take()
    bench.axis.blocked = True
    blocked_s = bench.now_s
    for _ in range(6):
        bench.cycle(0x000F, SPEED)
    ((time_s, code),) = emergencies(bench)
    assert code == 0x8611
    assert time_s == pytest.approx(blocked_s + 2000 / SPEED + 0.020, abs=0.002)
    assert bench.read(0x60F4, signed=True) > 2000
    assert bench.read(0x1001) == 0x21


def test_a_short_following_error_is_tolerated(bench: Bench) -> None:
    bench.configure()
    bench.write(0x6065, 0, 2000, 4)
    bench.write(0x6066, 0, 20, 2)
    bench.enable(SPEED)
    bench.axis.counts -= 3000
    bench.cycle(0x000F, SPEED)
    bench.axis.counts += 3000
    bench.take()
    for _ in range(10):
        bench.cycle(0x000F, SPEED)
    assert emergencies(bench) == []


def test_a_fault_lasts_until_a_rising_edge_resets_it(bench: Bench) -> None:
    start_motion(bench, sync_us=8000)
    bench.run_for(0.5)
    assert power(bench).state is PowerState.FAULT
    bench.cycle(0x000F)
    assert power(bench).state is PowerState.FAULT
    bench.take()
    bench.cycle(0x0080)
    bench.cycle(0x0080)
    assert power(bench).state is PowerState.SWITCH_ON_DISABLED
    assert [code for _, code in emergencies(bench)] == [0]
    assert bench.read(0x603F) == 0
    assert bench.read(0x1003, 1) == 0x8700, "the error history is kept after the reset"
    assert bench.write(0x1003, 0, 0, 1) == 0
    assert bench.read(0x1003, 1) == 0
