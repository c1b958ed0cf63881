"""Drive with a wrong clock: its durations are longer or shorter in proportion."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from drivers.canopen.frames import Frame
from mock_hw.drive.drive import BOOT_S
from mock_hw.drive.power_stage import DriveClock

Bench = Any
HEARTBEAT_LOST, RPDO_TIMEOUT, SYNC_LOST = 0x8130, 0x8250, 0x8700
RATES = pytest.mark.parametrize("rate", [0.5, 0.99, 1.0, 1.01, 4.0])


def first_emergency(bench: Bench) -> tuple[float, int]:
    ((time_s, frame),) = bench.take(0x083)
    return time_s, int.from_bytes(frame.data[:2], "little")


def test_a_correct_clock_changes_no_bit() -> None:
    assert DriveClock().true_duration_s(0.1) == 0.1


@RATES
def test_heartbeats_are_sent_at_its_rate(bench: Bench, rate: float) -> None:
    bench.run_to(0.05)
    bench.drive.clock.rate = rate
    assert not bench.write(0x1017, 0, 50, 2)
    bench.run_for(1.0 - 1e-6)
    times_s = [time_s for time_s, _ in bench.take(0x703)]
    assert len(times_s) == pytest.approx(20 * rate, abs=1)
    assert all(
        later - earlier == pytest.approx(0.05 / rate)
        for earlier, later in itertools.pairwise(times_s)
    )


@RATES
@pytest.mark.parametrize(
    ("watchdog", "code", "timeout_s"),
    [
        ({"heartbeat_ms": 80}, HEARTBEAT_LOST, 0.080),
        ({"rpdo_ms": 80}, RPDO_TIMEOUT, 0.080),
        ({"sync_us": 8000}, SYNC_LOST, 0.012),
    ],
    ids=["heartbeat", "set-points", "sync"],
)
def test_timeouts_of_a_drive_elapse_at_the_rate_of_its_clock(
    bench: Bench, rate: float, watchdog: dict[str, int], code: int, timeout_s: float
) -> None:
    bench.configure(**watchdog)
    bench.enable()
    bench.drive.clock.rate = rate
    bench.cycle(0x000F)
    if rate > 1.5 and timeout_s < 0.02:
        assert first_emergency(bench)[1] == code, (
            "the first cycle is already longer than this timeout"
        )
        return
    last_s = bench.now_s - 0.008
    bench.take()
    bench.run_for(0.5)
    time_s, found = first_emergency(bench)
    assert found == code
    assert time_s - last_s == pytest.approx(timeout_s / rate, abs=1e-6)


def test_a_drive_boots_at_the_rate_of_its_clock(bench: Bench) -> None:
    bench.run_to(0.05)
    bench.take()
    bench.drive.clock.rate = 0.5
    bench.receive(Frame(0, b"\x81\x00"))
    bench.run_for(2 * BOOT_S - 1e-4)
    assert bench.take(0x703) == []
    bench.run_for(2e-4)
    assert len(bench.take(0x703)) == 1


def test_a_drive_brakes_at_the_rate_of_its_clock(bench: Bench) -> None:
    """With a clock twice as fast, the ramp is half as long."""
    bench.configure(quick_stop_deceleration=1_000_000)
    bench.enable(100_000)
    bench.drive.clock.rate = 2.0
    bench.receive(Frame(0x203, b"\x02\x00" + b"\0" * 6))
    bench.receive(Frame(0x80, b""))
    bench.run_for(0.05 - 1e-4)
    assert bench.drive.power.powered
    bench.run_for(2e-4)
    assert not bench.drive.power.powered
