"""Loss of the bus, invalid motions and set-points, stop requests, and delays of the cyclic task."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from config.cell.cell import Supervision
from config.errors import PreflightError
from config.load import LoadedCell
from tests.builders.raised_codes import raises_code

T = 0.008
AT = 230
Measured = Callable[[str], None]


@pytest.mark.fault(12)
@pytest.mark.parametrize("kind", ["bus_off", "unplugged"])
def test_after_loss_of_the_adapter_no_motion_frame_is_sent_until_a_new_start(
    serve: Any, motion: MotionSamples, loaded: LoadedCell, kind: str, measured: Measured
) -> None:
    rig = serve(bus=[{"kind": kind, "at_cycle": AT, "duration_s": 0.6}])
    run = rig.move(motion)
    assert run.reason.code is StopCode.BUS
    lost_s = run.syncs_s[AT - 2] + T
    assert run.motion_frames_after(lost_s + T) == []
    safety = loaded.config.drive_safety
    speed = float(np.abs(run.truth.velocity[run.truth.at(lost_s)]).max())
    assert speed > 0.05
    allowed_s = 0.1 + 1.3 * speed / safety.quick_stop_deceleration_rad_s2 + 2 * T
    rest_s = run.truth.rest_s() - lost_s
    assert rest_s < allowed_s, "the drives must stop by themselves in time"
    rig.let_pass(1.0)
    assert [f for f in rig.frames() if f.time_s > lost_s + T and f.data[:2] == b"\x0f\0"] == []
    ended_s = rig.truth.time_s[-1]
    again = rig.move(motion)
    assert again.error is None
    assert again.reason is None
    assert again.motion_frames_after(ended_s), "the robot must move again after a new start"
    measured(
        f"{kind}: 0 motion frames; at rest {1e3 * rest_s:.0f} ms later by the drives' watchdogs"
    )


@pytest.mark.fault(12)
def test_a_babbling_node_that_blocks_the_bus_stops_the_motion(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    babble = {"identifier": 0x001, "count": 4000, "period_s": 1e-4, "at_cycle": AT}
    run = serve(bus=[{"kind": "strange", **babble}]).move(motion)
    assert run.reason is not None
    lost_s = run.syncs_s[AT - 2] + T
    assert run.truth.rest_s() < lost_s + 0.4
    assert run.truth.speed_after(lost_s + 0.4) < 1e-3
    rest_s = run.truth.rest_s() - lost_s
    measured(
        f"babbling node: stop reason {run.reason.code.name.lower()}, at rest {1e3 * rest_s:.0f} ms"
        " later"
    )


class FullQueue:
    """A port that refuses the set-points of one cycle with ENOBUFS, like a full kernel queue.

    It accepts frames again at once, so that a stored or repeated set-point is visible on the wire.
    """

    def __init__(self, port: Any, clock: Any) -> None:
        self._port, self._clock = port, clock
        self.syncs, self.refused, self.refused_s = 0, 0, math.inf

    def send_frames(self, frames: Any) -> None:
        frames = list(frames)
        self.syncs += sum(identifier == 0x080 for identifier, _ in frames)
        if self.syncs == AT and not self.refused and 0x201 in dict(frames):
            self.refused, self.refused_s = len(frames), self._clock.now_s()
            raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))
        self._port.send_frames(frames)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)


@pytest.mark.fault(12)
def test_a_full_transmit_queue_stops_the_motion_in_its_cycle(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    rig = serve()
    ports: list[FullQueue] = []

    def use_full_queue(cell: Any, _control: ControlBlock) -> None:
        ports.append(FullQueue(cell.link._port, cell.clock))
        cell.link._port = ports[0]

    run = rig.move(motion, use_full_queue)
    assert run.reason.code is StopCode.BUS
    assert "No buffer space available" in run.reason.text
    assert ports[0].refused >= 3
    last_s = ports[0].refused_s
    speed = float(np.abs(run.truth.velocity[run.truth.at(last_s)]).max())
    assert speed > 0.05, "nothing moved before the fault"
    assert run.motion_frames_after(last_s) == []
    stopped_s = max(run.quick_stops().values()) - last_s
    assert stopped_s < T, "the quick stop is sent in the same cycle"
    run.assert_at_rest()
    again = rig.move(motion)
    assert again.error is None
    assert again.reason is None
    measured(
        f"full queue: an error and the quick stop {1e3 * stopped_s:.1f} ms after the refusal, in"
        " the same cycle; 0 set-points afterwards"
    )


@pytest.mark.fault(16)
@pytest.mark.parametrize("what", ["position", "velocity", "torque"])
def test_a_motion_beyond_a_limit_is_refused_without_a_frame(
    serve: Any,
    motion: MotionSamples,
    loaded: LoadedCell,
    tmp_path: Any,
    what: str,
    measured: Measured,
) -> None:
    rig = serve()
    if what == "torque":
        wild = replace(motion, acceleration=motion.acceleration * 100.0)
    elif what == "velocity":
        wild = replace(motion, velocity=motion.velocity * 20.0)
    else:
        wild = replace(motion, position=motion.position * 30.0)
    folder = RunFolder.create(tmp_path / "runs", "beyond")
    with raises_code(PreflightError, "RID-MOTION-LIMIT"):
        record_motion(rig.config, loaded.robot, wild, folder)
    assert rig.frames() == [] or not any(f.can_id < 0x700 for f in rig.frames())
    measured(f"{what}: refused, 0 frames sent")


@pytest.mark.fault(17)
@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("NaN", lambda row: math.nan),
        ("infinity", lambda row: math.inf),
        ("a jump of 0.3 rad", lambda row: row + 0.3),
    ],
    ids=["nan", "infinity", "jump"],
)
def test_an_invalid_set_point_is_not_sent(
    serve: Any,
    motion: MotionSamples,
    name: str,
    spoil: Callable[[float], float],
    measured: Measured,
) -> None:
    at = 100
    position = motion.position.copy()
    position[at, 1] = spoil(position[at, 1])
    wild = replace(motion)
    object.__setattr__(wild, "position", position)  # bypass the checks of a motion
    run = serve().move(wild)
    assert (run.reason.code, run.reason.joint) == (StopCode.SET_POINT, "axis2")
    row = np.flatnonzero(run.rows["sample_index"] == at)
    assert len(row) == 1
    assert not run.rows["velocity_command"][row].any(), "the set-point is not sent"
    assert np.abs(run.rows["velocity_command"]).max() < 1.1 * np.abs(motion.velocity).max()
    assert run.motion_frames_after(run.rows["time_s"][row[0]]) == []
    run.assert_at_rest()
    measured(f"{name}: 0 wrong commands sent, quick stop in the same cycle")


@pytest.mark.fault(19)
def test_a_stop_request_causes_a_quick_stop_within_two_cycles(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    """Request a stop through the control block, as the program does on a signal."""
    rig = serve(bus=[{"kind": "strange", "identifier": 0x3F1, "at_cycle": AT}])
    requested_s: list[float] = []

    def stop_at_frame(cell: Any, control: ControlBlock) -> None:
        take, watch = cell.axes.take_events, cell.axes.watch

        def stop_and_take_events() -> Any:
            if watch.unexpected_frames and not requested_s:
                requested_s.append(cell.clock.now_s())
                for _ in range(5):  # Ctrl-C five times
                    control.program.request_stop(StopCode.INTERRUPTED)
            return take()

        cell.axes.take_events = stop_and_take_events

    run = rig.move(motion, stop_at_frame)
    assert run.reason.code is StopCode.INTERRUPTED
    cycles = run.quick_stop_cycle() - run.cycle(requested_s[0])
    assert cycles <= 2
    run.assert_at_rest()
    measured(f"quick stop {cycles} T after the request")


STRICT = Supervision(stuck_encoder_velocity_rad_s=0.2)


@pytest.mark.fault(27)
@pytest.mark.parametrize(
    ("held", "stops"),
    [
        ({"duration_s": 1.2 * T}, False),
        ({"duration_s": 0.7 * T, "count": 3}, True),
        ({"duration_s": 0.05}, True),
        ({"duration_s": 0.2}, True),
    ],
    ids=["one cycle", "three cycles", "50 ms", "200 ms"],
)
def test_a_delayed_task_skips_one_cycle_or_sends_a_quick_stop_first(
    serve: Any, motion: MotionSamples, held: dict[str, float], stops: bool, measured: Measured
) -> None:
    rig = serve(bus=[{"kind": "held_up", "at_cycle": AT, **held}])
    strict = rig.config.model_copy(update={"supervision": STRICT})
    run = rig.move(motion, config=strict)
    commands = [f.time_s for f in run.frames if 0x201 <= f.can_id <= 0x203 and f.word == 0x000F]
    gaps = np.diff(run.syncs_s)
    words = f"{1e3 * held['duration_s']:.1f} ms" + (" x 3" if "count" in held else "")
    if not stops:
        assert run.reason is None
        rows = run.rows
        assert np.sum(np.diff(rows["cycle"].astype(int)) - 1) == 1
        assert rows["lateness_s"].max() == pytest.approx(held["duration_s"])
        assert len([g for g in gaps if g < 0.75 * T]) == 0
        measured(f"{words}: 1 cycle skipped and counted, the motion continues")
        return
    assert run.reason.code is StopCode.LATE_CYCLE
    stop_s = min(run.quick_stops().values())
    assert [t for t in commands if t > stop_s] == []
    late = np.argmax(np.diff(commands[: len(commands) // 3 * 3 : 3]) > 1.5 * T)
    assert held.get("count") or late == 0, "no set-point after the pause"
    run.assert_at_rest(held["duration_s"] + T)
    measured(f"{words}: quick stop before any set-point, 0 set-points after it")
