"""Load changes that digital inputs trigger, and a streamed path during which they occur."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.motion.load_changes import LoadChange, LoadChanges
from acquisition.motion.load_signal import LoadSignal
from acquisition.supervision.cycle import SetPoint
from compensation.online.load_signals import LoadSignals
from compensation.online.online import OnlineFeedforward
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from compensation.ramped_load import RampedLoad
from drivers.interfaces.servo_axes import Answers
from identification.estimation.estimate import Estimate
from identification.payload.carried import carry
from tests.builders.certified import estimate_of
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import (
    CELL,
    Points,
    T,
    answers_at,
    arrays,
    loops_of,
    planned,
)

AT_S, RAMP_S, BIT = 1.0, 0.1, 17
ALONE = known_estimate(CELL, {})
PAYLOAD = estimate_of(CELL, ("run",))
LOADED = carry(ALONE, replace(PAYLOAD, values=0.5 * PAYLOAD.values))
Levels = Callable[[float], bool]


def change(at_s: float = AT_S, payload: str = "model", **signal: Any) -> LoadChange:
    """Return a load change at an input of axis 2; `signal` replaces keys of its signal."""
    keys: dict[str, Any] = {"joint": "axis2", "bit": BIT, "debounce_s": 0.0}
    keys |= {"early_s": 0.1, "late_s": 0.2, "missed": "stop"}
    own = LoadSignal.model_validate(keys | signal)
    return LoadChange(at_s=at_s, payload=payload, ramp_s=RAMP_S, signal=own)


def forward_of(*changes: LoadChange, loads: tuple[Estimate, ...] = (LOADED,)) -> OnlineFeedforward:
    """Return the online feedforward of an arm without load, and with a load after each change."""
    begin_s = np.array([each.at_s for each in changes])
    load = RampedLoad((ALONE, *loads), begin_s, np.full(len(changes), RAMP_S))
    forward = OnlineFeedforward.from_model(CELL.config, CELL.robot, load, loops_of(CELL))
    if all(each.signal is None for each in changes):
        return forward
    stated = LoadChanges(changes=changes)
    return replace(forward, signals=LoadSignals(stated, CELL.robot.joint_names, T))


def source_of(forward: OnlineFeedforward) -> PointSource:
    points = planned().position
    ring = PointRing.create(3, len(points))
    ring.write(np.asarray(points))
    ring.end()
    source = PointSource(forward, ring)
    source.prepare()
    source.begin(False, np.zeros(3))
    return source


def follow(source: PointSource, level: Levels, lost: Levels = lambda _: False) -> list[SetPoint]:
    """Return the set-points of a whole path.

    `level` and `lost` are functions of the time of the path [s]: the level of the input of axis 2,
    and True if the answer of its drive is lost.
    """
    points: list[SetPoint] = []
    for row in range(5000):
        time_s = points[-1].sample_index * T if points else -T  # the last row of the approach
        position = np.array(points[-1].position) if points else planned().position[0]
        source.watch(answers_of(position, level(time_s), lost(time_s)))
        point = source.at(row)
        if point is None:
            return points
        points.append(point)
    raise AssertionError("the robot did not come to rest")


def answers_of(position: Points, level: bool, lost: bool = False) -> Answers:
    """Return the drives' answers with a level of the input of axis 2.

    If `lost`, the answer of axis 2 is missing.
    """
    answers = answers_at(position, inputs=(0, int(level) << BIT, 0))
    answers.received[1] = not lost
    return answers


def from_time(time_s: float) -> Levels:
    return lambda now_s: now_s >= time_s


def outcomes_of(source: PointSource) -> list[str | None]:
    return [each.outcome for each in changes_of(source)]


def changes_of(source: PointSource) -> tuple[LoadChange, ...]:
    signals = source._feedforward.signals
    assert signals is not None
    return signals.changes.changes


def stated_at(time_s: float, load: Estimate = LOADED) -> Points:
    """Return the feedforward [rad/s], (samples, joints), with a load change at a stated time."""
    stated = LoadChange(at_s=time_s, payload="model", ramp_s=RAMP_S)
    return arrays(follow(source_of(forward_of(stated, loads=(load,))), lambda _: False))[2]
