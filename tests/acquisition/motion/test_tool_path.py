"""Paths of lines, arcs, circles and splines: positions, speeds and refused files."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.tool_path import PathMotion
from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import load_robot
from dynamics.geometry.kinematics import Chain, forward, link_transforms
from tests.builders.raised_codes import raises_code

Segment = dict[str, object]
ROBOT = load_robot("ir361")
CHAIN = Chain.from_description(ROBOT)
T = 0.008
START = (0.6, -0.2, -1.7)
CORNER = (0.6, 0.1, -1.7)
THROUGH = ((0.75, 0.0, -1.55), (0.6, 0.1, -1.5), (0.6, -0.1, -1.65), (0.65, -0.2, -1.7))
LINE: Segment = {"kind": "line", "to_m": CORNER}
BEND: Segment = {"kind": "line", "to_m": (0.8, 0.1, -1.7)}
ARC: Segment = {"kind": "arc", "through_m": (0.9, 0.0, -1.7), "to_m": (0.8, -0.1, -1.7)}
SPLINE: Segment = {"kind": "spline", "through_m": THROUGH}


def path(*segments: Segment, **changes: object) -> PathMotion:
    fields = {
        "kind": "path",
        "robot": "ir361",
        "start_m": START,
        "near": (0.1, -0.1, 0.4),
        "speed_m_s": 0.4,
        "segments": segments,
    }
    return PathMotion.model_validate(fields | changes)


def tool_points(samples: MotionSamples) -> FloatArray:
    return forward(CHAIN, samples.position)


def largest_rates(points: FloatArray) -> tuple[float, float, float]:
    """Return the largest speed (m/s), acceleration (m/s²) and jerk (m/s³) by differences."""
    found = []
    for _ in range(3):
        points = np.diff(points, axis=0) / T
        found.append(float(np.linalg.norm(points, axis=1).max()))
    return found[0], found[1], found[2]


def largest_distance(points: FloatArray, others: FloatArray) -> float:
    """Return the largest distance between a point of `points` and its nearest point in `others`."""
    return max(float(np.linalg.norm(others - p, axis=1).min()) for p in points)


def test_a_line_is_straight_and_within_its_speed_acceleration_and_jerk() -> None:
    samples = path(LINE).plan(ROBOT, T)
    points = tool_points(samples)
    np.testing.assert_allclose(points[0], START, atol=1e-9)
    np.testing.assert_allclose(points[-1], CORNER, atol=1e-9)
    np.testing.assert_allclose(points[:, [0, 2]], np.tile([0.6, -1.7], (len(points), 1)), atol=1e-9)
    speed, acceleration, jerk = largest_rates(points)
    assert speed == pytest.approx(0.4, rel=1e-6)
    assert 2.0 < acceleration <= 4.0 * 1.001
    assert jerk <= 80.0 * 1.001
    # 0.3 m at 0.4 m/s; two ramps of v / a plus smoothing, each at half speed on average
    assert (samples.phase == Phase.MAIN).sum() * T == pytest.approx(
        0.3 / 0.4 + 0.4 / 4.0 + 1.5 * 0.1, abs=3 * T
    )


def test_velocity_and_acceleration_are_the_positions_own() -> None:
    samples = path(LINE, BEND, ARC, SPLINE, blend_m=0.03).plan(ROBOT, T)
    slope = np.diff(samples.position, axis=0) / T
    bend = np.diff(samples.velocity, axis=0) / T
    middle = (samples.velocity[1:] + samples.velocity[:-1]) / 2.0
    np.testing.assert_allclose(slope, middle, atol=2e-3)
    np.testing.assert_allclose(
        bend, (samples.acceleration[1:] + samples.acceleration[:-1]) / 2.0, atol=0.2
    )
    for values in (samples.velocity, samples.acceleration):
        assert not values[[0, -1]].any()


def test_the_tool_point_passes_through_every_segment() -> None:
    motion = path(LINE, BEND, ARC, SPLINE)
    points = tool_points(motion.plan(ROBOT, T))
    for point in ((0.6, 0.1, -1.7), (0.8, 0.1, -1.7), (0.8, -0.1, -1.7)):  # stops
        assert largest_distance(np.array([point]), points) < 1e-9
    assert largest_distance(np.array(THROUGH), points) < 2e-3  # one cycle at 0.4 m/s
    arc = points[(points[:, 0] > 0.8001) & (abs(points[:, 2] + 1.7) < 1e-6)]
    assert len(arc) > 50
    np.testing.assert_allclose(np.linalg.norm(arc - [0.8, 0.0, -1.7], axis=1), 0.1, atol=1e-8)


def test_a_blended_corner_is_driven_without_a_stop_within_all_limits() -> None:
    stopping = path(LINE, BEND).plan(ROBOT, T)
    blending = path(LINE, BEND, blend_m=0.05).plan(ROBOT, T)
    assert blending.duration_s < stopping.duration_s - 0.2
    points = tool_points(blending)
    corner = np.array(CORNER)
    # the quintic passes the corner at 3/16 of its length, along the bisector
    assert np.linalg.norm(points - corner, axis=1).min() == pytest.approx(
        0.05 * 3.0 / 16.0 * np.sqrt(2.0), abs=1e-4
    )
    far = np.linalg.norm(points - corner, axis=1) > 0.0501
    on_lines = np.minimum(abs(points[:, 0] - 0.6), abs(points[:, 1] - 0.1))
    assert on_lines[far].max() < 1e-9
    main = points[blending.phase == Phase.MAIN]
    speeds = np.linalg.norm(np.diff(main, axis=0), axis=1) / T
    assert speeds[30:-30].min() > 0.1
    speed, acceleration, _ = largest_rates(points)
    assert speed <= 0.4 * 1.0001
    assert acceleration <= 4.0 * np.sqrt(2.0)  # along and across


def test_a_blend_takes_at_most_half_a_segment() -> None:
    short: Segment = {"kind": "line", "to_m": (0.6, -0.18, -1.7)}
    motion = path(short, {"kind": "line", "to_m": (0.65, -0.18, -1.7)}, blend_m=1.0)
    (stretch,) = motion.sections()
    assert [piece.label for piece in stretch.pieces] == [
        "segment 1 (line)",
        "the corner between segments 1 and 2",
        "segment 2 (line)",
    ]
    assert stretch.pieces[0].length_m == pytest.approx(0.01)


def test_tangential_segments_need_neither_blend_nor_stop() -> None:
    straight_on: Segment = {"kind": "line", "to_m": (0.6, 0.2, -1.7)}
    assert len(path(LINE, straight_on).sections()) == 1
    assert len(path(LINE, BEND).sections()) == 2


def test_a_circle_segment_ends_where_it_starts() -> None:
    turn: Segment = {"kind": "circle", "centre_m": (0.7, -0.2, -1.7), "turns": -1.0}
    samples = path(turn).plan(ROBOT, T)
    points = tool_points(samples)
    np.testing.assert_allclose(points[-1], START, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points - [0.7, -0.2, -1.7], axis=1), 0.1, atol=1e-9)
    assert largest_rates(points)[1] <= 4.0 * np.sqrt(2.0)


@pytest.mark.parametrize("speed", [0.5, 5.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_limit_holds_at_any_requested_speed(seed: int, speed: float) -> None:
    """Draw splines through random points; the joints limit the speed if the path does not."""
    random = np.random.default_rng(seed)
    box = np.array([(0.5, 0.8), (-0.3, 0.3), (-1.8, -1.4)])
    points = tuple(tuple(p) for p in random.uniform(box[:, 0], box[:, 1], (6, 3)).tolist())
    wild = {"acceleration_m_s2": 40.0, "jerk_m_s3": 2000.0} if speed > 1.0 else {}
    motion = path({"kind": "spline", "through_m": points}, speed_m_s=speed, **wild)
    samples = motion.plan(ROBOT, T)
    verify_limits(samples, ROBOT)
    used = np.abs(samples.velocity).max(axis=0) / [j.limits.velocity for j in ROBOT.joints]
    gained = np.abs(samples.acceleration).max(axis=0) / [
        j.limits.acceleration for j in ROBOT.joints
    ]
    if speed > 1.0:
        assert max(used.max(), gained.max()) > 0.6
    assert largest_rates(tool_points(samples))[0] <= speed * 1.0001


def test_a_robot_with_six_axes_keeps_its_orientation_along_a_path() -> None:
    robot = load_robot("ur10e")
    near = (0.3, -1.2, 1.5, -1.8, -1.5, 0.2)
    chain = Chain.from_description(robot)
    start = forward(chain, np.array([near]))[0]
    to = [tuple((start + way).tolist()) for way in ([0.0, 0.2, 0.0], [0.1, 0.2, 0.1])]
    lines: list[Segment] = [{"kind": "line", "to_m": point} for point in to]
    motion = path(
        *lines,
        robot="ur10e",
        start_m=tuple(start.tolist()),
        near=near,
        blend_m=0.02,
    )
    samples = motion.plan(robot, T)
    poses = link_transforms(chain, samples.position)[:, -1, :3, :3]
    wanted = link_transforms(chain, np.array([near]))[0, -1, :3, :3]
    np.testing.assert_allclose(poses, np.broadcast_to(wanted, poses.shape), atol=1e-9)
    np.testing.assert_allclose(forward(chain, samples.position[-1:])[0], to[1], atol=1e-9)


def test_a_row_of_the_motion_is_located_by_its_segment() -> None:
    motion = path(LINE, BEND, blend_m=0.02)
    samples = motion.plan(ROBOT, T)
    assert motion.where(ROBOT, T, 30) == "segment 1 (line), 0 mm into it"
    assert motion.where(ROBOT, T, len(samples) - 40).startswith("segment 2 (line), 1")
    assert motion.where(ROBOT, T, len(samples) - 1) == "the end of the path"


@pytest.mark.parametrize(
    ("segments", "changes", "code", "details"),
    [
        (
            ({"kind": "line", "to_m": (1.5, -0.2, -1.7)},),
            {},
            "RID-PATH-SINGULAR",
            ("segment 1 (line)", "428 mm"),
        ),
        (
            (LINE, {"kind": "line", "to_m": (0.0, 0.0, -1.7)}),
            {},
            "RID-PATH-SINGULAR",
            ("segment 2 (line)", "608 mm"),
        ),
        ((LINE, LINE), {}, "RID-PATH-SEGMENT", ("segment 2 (line)", "(600.0, 100.0, -1700.0) mm")),
        (
            (LINE, {**ARC, "to_m": (1.2, -0.1, -1.7)}),
            {},
            "RID-PATH-SEGMENT",
            ("segment 2 (arc)", "(1200.0, -100.0, -1700.0) mm"),
        ),
        (
            ({"kind": "circle", "centre_m": (0.7, -0.2, -1.6)},),
            {},
            "RID-PATH-SEGMENT",
            ("segment 1 (circle)", "100 mm", "plane", "141 mm"),
        ),
        (
            ({"kind": "spline", "through_m": ((0.7, 0.0, -1.6), (0.7, 0.0, -1.6))},),
            {},
            "RID-PATH-SEGMENT",
            ("segment 1 (spline)", "point 2, "),
        ),
        (
            (LINE, {"kind": "line", "to_m": START}),
            {"blend_m": 0.01},
            "RID-PATH-SEGMENT",
            ("segments 1 and 2", "blend_m: 0"),
        ),
        (
            ({"kind": "circle", "centre_m": (0.0, 0.0, -1.7), "turns": 0.6},),
            {},
            "RID-PATH-REACH",
            ("segment 1 (circle)", "1911 mm", "'axis1'", "-2.7 to 2.7"),
        ),
        ((BEND,), {"near": (0.1, -0.1)}, "RID-MOTION-JOINTS", ("near", "2 values")),
        (
            (LINE, BEND),
            {"blend_m": 0.01, "keep_speed": True},
            "RID-MOTION-LIMIT",
            ("segments 1 and 2", " 0.4 m/s", "0.117 m/s", "jerk_m_s3"),
        ),
        (
            (BEND,),
            {"speed_m_s": 4.0, "keep_speed": True},
            "RID-MOTION-LIMIT",
            (" 4 m/s", "acceleration limit", "'axis2'", "1.35 m/s"),
        ),
        ((BEND,), {"speed_m_s": 1e-6}, "RID-MOTION-LONG", ("360555 s", "14400 s")),
    ],
)
def test_an_undrivable_path_is_refused_with_its_segment(
    segments: tuple[Segment, ...],
    changes: dict[str, object],
    code: str,
    details: tuple[str, ...],
) -> None:
    with raises_code(ConfigError, code, *details):
        path(*segments, **changes).plan(ROBOT, T)
