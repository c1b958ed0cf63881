"""Streams of points for the bundled arm, and requirements on the resulting set-points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples
from acquisition.supervision.cycle import SetPoint
from benchmarks.closed_loop import true_loops
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import LARGEST_CORRECTION, REST_RAD_S, OnlineFeedforward
from compensation.online.point_ring import PointRing
from compensation.online.point_source import PointSource
from config.load import LoadedCell, load_cell
from drivers.interfaces.servo_axes import Answers
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters

CELL = load_cell("ir361")
T = CELL.config.cycle_time_s
LIMITS = [joint.limits for joint in CELL.robot.joints]
SPEED = np.array([limit.velocity for limit in LIMITS])
ACCELERATION = np.array([limit.acceleration for limit in LIMITS])
LOW = np.array([limit.position_min for limit in LIMITS])
HIGH = np.array([limit.position_max for limit in LIMITS])
ROUNDING = 1.02  # PointSource tolerates 1 %; the rest is the error of the difference quotient

Points = NDArray[np.float64]


def loops_of(cell: LoadedCell) -> list[VelocityLoop]:
    return [replace(loop, delay_s=0.0005, lag_s=0.0) for loop in true_loops(cell)]


def true_model(cell: LoadedCell) -> tuple[RobotModel, Points]:
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    return model, true_parameters(model, cell.robot, cell.plant)


FORWARD = OnlineFeedforward.of(
    CELL.config,
    CELL.robot,
    SampleTorque.of(*true_model(CELL), least_smoothing_rad_s=REST_RAD_S),
    loops_of(CELL),
)


def answers_at(
    position: Points, counts_per_rad: float = 1e6, inputs: tuple[int, ...] = (0, 0, 0)
) -> Answers:
    """Return answers of all drives at a position [rad], with these digital inputs."""
    answers = Answers.initial(len(position))
    answers.received[:] = True
    answers.position[:] = position
    answers.position_counts[:] = np.rint(counts_per_rad * position)
    answers.inputs[:] = inputs
    return answers


DISTANCES = (2e-3, 1e-3, 3e-3)
"""Presliding distance of each joint [rad]."""


def remembering() -> tuple[RobotModel, Points]:
    """Return the arm's model with presliding hysteresis, and its true parameters."""
    joints = tuple(
        joint.model_copy(
            update={"friction": (*joint.friction, "presliding"), "presliding_distance": distance}
        )
        for joint, distance in zip(CELL.robot.joints, DISTANCES, strict=True)
    )
    model = RobotModel.from_description(CELL.robot.model_copy(update={"joints": joints}))
    assert CELL.plant is not None
    return model, true_parameters(model, CELL.robot, CELL.plant)


REMEMBERING = OnlineFeedforward.of(
    CELL.config,
    CELL.robot,
    SampleTorque.of(*remembering(), least_smoothing_rad_s=REST_RAD_S),
    loops_of(CELL),
)


def source_of(
    forward: OnlineFeedforward, points: Points, *, end: bool = True, capacity: int | None = None
) -> PointSource:
    """Return a source of points that runs in real time and does not wait for missing points."""
    ring = PointRing.create(points.shape[1], capacity or len(points))
    ring.write(points)
    if end:
        ring.end()
    source = PointSource(forward, ring, prefill_patience_s=0.0)
    source.prepare()
    source.begin(False, np.zeros(points.shape[1]))
    return source


def drive(source: PointSource, rows: Iterable[int] | None = None) -> list[SetPoint]:
    out: list[SetPoint] = []
    for row in range(100_000) if rows is None else rows:
        point = source.at(row)
        if point is None:
            return out
        out.append(point)
    raise AssertionError("the stream did not come to rest")


def waves(seed: int, count: int, size: float = 0.5) -> Points:
    """Return a smooth path [rad], (count, 3), that starts at rest and does not end at rest.

    With the default size it is within all limits.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(count)[:, np.newaxis] * T
    rise = np.clip(time_s / 1.0, 0.0, 1.0)
    rise = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    pulse = rng.uniform(1.0, 4.0, 3)
    bound = 0.4 * size * np.minimum(ACCELERATION / (pulse + 6.0) ** 2, SPEED / (pulse + 2.0))
    middle = 0.5 * (LOW + HIGH)
    return np.asarray(middle + rise * bound * np.sin(pulse * time_s + rng.uniform(0.0, 6.0, 3)))


def planned(seed: int = 1) -> MotionSamples:
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=3, seed=seed)
    return motion.plan(CELL.robot, T)


def arrays(points: list[SetPoint]) -> tuple[Points, Points, Points]:
    return (
        np.array([p.position for p in points]),
        np.array([p.velocity for p in points]),
        np.array([p.feedforward for p in points]),
    )


def held_limits(points: list[SetPoint]) -> None:
    """Assert that the points respect all limits, have no jumps, and end at rest."""
    position, velocity, ahead = arrays(points)
    assert np.isfinite(position).all()
    assert np.isfinite(velocity).all()
    assert np.isfinite(ahead).all()
    assert (position >= LOW - 1e-6).all()
    assert (position <= HIGH + 1e-6).all()
    assert (np.abs(velocity) <= ROUNDING * SPEED).all()
    assert (np.abs(ahead) <= ROUNDING * SPEED).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= ROUNDING * ACCELERATION * T).all()
    steps = np.diff(position, axis=0) - 0.5 * T * (velocity[1:] + velocity[:-1])
    assert (np.abs(steps) <= ROUNDING * ACCELERATION * T**2).all(), (
        "the positions do not match the velocities"
    )
    assert (np.abs(ahead - velocity) <= 1.3 * LARGEST_CORRECTION * SPEED).all()
    assert not velocity[-1].any()
    assert not ahead[-1].any()


Spoiler = st.sampled_from(["no", "nan", "inf", "jump", "step", "noise", "huge", "freeze", "back"])


@st.composite
def streams(draw: st.DrawFn) -> tuple[Points, list[int], bool, list[int]]:
    """Draw a stream: points, points per cycle, an end mark, and skipped cycles.

    The points [rad], (points, 3), can be invalid. The third value is True if the stream has an end
    mark.
    """
    path = waves(draw(st.integers(0, 50)), draw(st.integers(1, 500)), draw(st.floats(0.05, 3.0)))
    at = draw(st.integers(0, len(path) - 1))
    joint, size = draw(st.integers(0, 2)), draw(st.floats(-3.0, 3.0))
    match draw(Spoiler):
        case "nan":
            path[at, joint] = np.nan
        case "inf":
            path[at, joint] = np.copysign(np.inf, size)
        case "jump":
            path[at, joint] += size
        case "step":
            path[at:, joint] += size
        case "noise":
            noise = np.random.default_rng(at).standard_normal(path[at:].shape)
            path[at:] += 10.0 ** (2.0 * size - 4.0) * noise
        case "huge":
            path[at] *= 1e300
        case "freeze":
            path[at:] = path[at]
        case "back":
            path[at:] = path[at::-1][: len(path) - at].copy() if at > len(path) // 2 else path[at:]
        case _:
            pass
    path = np.array(path)
    if draw(st.booleans()):
        path = np.concatenate([path, np.tile(path[-1], (10, 1))])
    pace = draw(st.lists(st.integers(0, 6), max_size=40))
    late = draw(st.lists(st.integers(1, 300), max_size=5))
    return path, pace, draw(st.booleans()), late
