"""A motion that the service started stops if the service's heartbeat or the client's lease ends."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.service_beat import SERVICE_LIMIT_S, ServiceBeat
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from tests.acquisition.task.test_cyclic_task import Bench


@pytest.fixture
def bench(cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> Bench:
    return Bench(cell, robot, axes, clock)


def hang_service(bench: Bench) -> Callable[[Any, int], None]:
    def script(axes: Any, cycle: int) -> None:
        if cycle >= 150:
            bench.now.now_s = 100.1 + SERVICE_LIMIT_S

    return script


def end_lease(bench: Bench) -> Callable[[Any, int], None]:
    bench.service.write(bench.now.now_s, lease_end_s=102.0)

    def script(axes: Any, cycle: int) -> None:
        if cycle >= 150:
            bench.now.now_s = 102.0

    return script


@pytest.mark.promise("service-heartbeat")
@pytest.mark.parametrize(
    ("order", "code"),
    [(hang_service, StopCode.SERVICE_LOST), (end_lease, StopCode.CLIENT_LOST)],
)
def test_a_motion_stops_in_the_next_cycle_after_a_lost_service_or_lease(
    bench: Bench,
    motion: MotionSamples,
    order: Callable[[Bench], Callable[[Any, int], None]],
    code: StopCode,
) -> None:
    bench.axes.script = order(bench)
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is code
    assert bench.axes.stopped_at == 150
    assert bench.axes.calls[-1] == "disable"


@pytest.mark.promise("service-heartbeat")
@pytest.mark.parametrize(
    ("now_s", "lease_end_s", "code"),
    [
        (100.1 + SERVICE_LIMIT_S, inf, StopCode.SERVICE_LOST),
        (101.0, 101.0, StopCode.CLIENT_LOST),
        (101.0, -inf, StopCode.CLIENT_LOST),
    ],
)
def test_no_drive_is_enabled_without_service_or_lease(
    bench: Bench, motion: MotionSamples, now_s: float, lease_end_s: float, code: StopCode
) -> None:
    bench.service.write(bench.now.now_s, lease_end_s)
    bench.now.now_s = now_s
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is code
    assert bench.axes.calls == []


@pytest.mark.promise("service-heartbeat")
def test_a_service_that_recovers_does_not_cancel_the_stop(
    bench: Bench, motion: MotionSamples
) -> None:
    def script(axes: Any, cycle: int) -> None:
        bench.now.now_s = 200.0 if cycle == 150 else bench.now.now_s
        if cycle > 150:
            bench.service.write(bench.now.now_s, inf)

    bench.axes.script = script
    reason = bench.run(motion)
    assert reason is not None
    assert reason.code is StopCode.SERVICE_LOST
    assert bench.axes.stopped_at == 150


@pytest.mark.promise("service-heartbeat")
def test_a_motion_continues_while_the_service_gives_signs_of_life(
    bench: Bench, motion: MotionSamples
) -> None:
    def script(axes: Any, cycle: int) -> None:
        if cycle % 10 == 0:
            bench.now.now_s += SERVICE_LIMIT_S - 0.1
            bench.service.write(bench.now.now_s, lease_end_s=bench.now.now_s + 5.0)

    bench.axes.script = script
    assert bench.run(motion) is None


def report_heartbeat_verdicts(service: ServiceBeat, found: Any) -> None:
    """Send the stop codes that this process derives from the service's heartbeat at 1 s and 9 s.

    "" means no stop.
    """
    found.put([reason.code.name if (reason := service.reason(at_s)) else "" for at_s in (1.0, 9.0)])


@pytest.mark.promise("service-heartbeat")
def test_another_process_sees_the_same_signs_of_life() -> None:
    service = ServiceBeat.create()
    context = multiprocessing.get_context("spawn")
    found: Any = context.SimpleQueue()
    service.write(1.0, lease_end_s=inf)
    process = context.Process(target=report_heartbeat_verdicts, args=(service, found))
    process.start()
    assert found.get() == ["", "SERVICE_LOST"]
    process.join()
