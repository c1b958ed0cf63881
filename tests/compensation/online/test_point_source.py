"""On-line stage of the compensation: it computes feedforward for valid points, and stops or refuses
invalid points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acquisition.motion.samples import Phase
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopCode
from compensation.feedforward.inverse import CYCLES_TO_ACT, feedforward
from compensation.online.online import OnlineFeedforward
from compensation.online.path_kernels import ARRIVED, STATE
from compensation.online.point_ring import PointRing, PointsFailed
from compensation.online.point_source import PointSource
from config.errors import ConfigError, DriverError
from dynamics.model.robot_model import torque
from tests.builders.point_streams import (
    ACCELERATION,
    CELL,
    FORWARD,
    REMEMBERING,
    ROUNDING,
    SPEED,
    Points,
    T,
    answers_at,
    arrays,
    drive,
    held_limits,
    loops_of,
    planned,
    source_of,
    streams,
    true_model,
    waves,
)
from tests.builders.raised_codes import raises_code


@pytest.fixture
def forward() -> OnlineFeedforward:
    return FORWARD


class TestGoodPoints:
    def test_every_point_is_sent_in_its_cycle(self, forward: OnlineFeedforward) -> None:
        samples = planned()
        source = source_of(forward, samples.position)
        points = drive(source)
        position, velocity, _ = arrays(points)
        np.testing.assert_allclose(position[1 : len(samples) + 1], samples.position, atol=1e-12)
        np.testing.assert_allclose(velocity[1 : len(samples) + 1], samples.velocity, atol=2e-4)
        assert [p.sample_index for p in points[1 : len(samples) + 1]] == list(range(len(samples)))
        assert source.stop is None
        assert source.notes == []
        held_limits(points)

    def test_the_feedforward_equals_that_of_the_whole_motion(
        self, forward: OnlineFeedforward
    ) -> None:
        """The median difference is below 1e-5 rad/s, and 95 % of all differences are below 2e-3
        rad/s.
        """
        samples = planned()
        _, _, ahead = arrays(drive(source_of(forward, samples.position)))
        model, parameters = true_model(CELL)
        wanted = torque(model, samples.position, samples.velocity, samples.acceleration, parameters)
        expected = feedforward(loops_of(CELL), samples.velocity, wanted, T)
        faded_in = slice(20, len(samples) - 5)
        found = ahead[1 : len(samples) + 1][faded_in]
        difference = np.abs(found - expected[faded_in])
        assert np.median(difference) < 1e-5
        # When a joint starts to move or reverses, its friction changes within some cycles.
        assert np.mean(difference < 2e-3) > 0.95

    def test_at_rest_the_feedforward_is_zero_for_any_load(self, forward: OnlineFeedforward) -> None:
        pose = np.tile([0.3, -0.4, 0.5], (50, 1))
        assert np.abs(arrays(drive(source_of(forward, pose)))[2]).max() < 1e-12

    def test_without_compensation_the_feedforward_is_the_paths_velocity(
        self, forward: OnlineFeedforward
    ) -> None:
        samples = planned()
        ring = PointRing.create(3, len(samples))
        ring.write(np.asarray(samples.position))
        ring.end()
        source = PointSource(forward, ring, compensated=False)
        source.prepare()
        source.begin(True, np.zeros(3))
        _, velocity, ahead = arrays(drive(source))
        np.testing.assert_array_equal(velocity, ahead)
        assert source.notes == []

    def test_phases_and_period_of_a_file_are_kept(self, forward: OnlineFeedforward) -> None:
        samples = planned()
        ring = PointRing.create(3, len(samples))
        ring.write(np.asarray(samples.position))
        ring.end()
        phase = samples.phase.copy()
        phase[:40] = Phase.RUN_IN
        source = PointSource(forward, ring, phase=phase, samples_per_period=7)
        source.prepare()
        source.begin(True, np.zeros(3))
        points = drive(source)
        assert [p.phase for p in points[1:100]] == phase[:99].tolist()
        assert source.samples_per_period == 7
        assert source.rows_expected == len(samples)


class TestStops:
    def test_a_stalled_stream_stops_the_robot_on_its_path(self, forward: OnlineFeedforward) -> None:
        path = waves(3, 500)
        source = source_of(forward, path, end=False)
        points = drive(source)
        held_limits(points)
        assert source.stop is not None
        assert source.stop.code is StopCode.POINTS_LOST
        position = arrays(points)[0]
        driven = position[:, np.newaxis, :] - path[np.newaxis]
        nearest = np.abs(driven).max(axis=2).min(axis=1)
        assert nearest.max() < 1.1 * np.abs(np.diff(path, axis=0)).max(), "the axes left the path"
        assert points[-1].sample_index < len(path)
        assert points[-1].sample_index > 400, "the stop came earlier than necessary"

    def test_an_endless_stream_of_points_is_driven(self, forward: OnlineFeedforward) -> None:
        path = waves(4, 3000)
        ring = PointRing.create(3, 100)
        assert ring.write(path) == 100
        source = PointSource(forward, ring, prefill_patience_s=0.0)
        source.prepare()
        source.begin(False, np.zeros(3))
        sent, points = 100, []
        for row in range(3200):
            sent += ring.write(path[sent : sent + 3])
            point = source.at(row)
            if point is None:
                break
            points.append(point)
        held_limits(points)
        assert source.stop is not None
        assert points[-1].sample_index > 2900

    @pytest.mark.parametrize(
        ("spoil", "text"),
        [
            (lambda q: q * np.nan, "is not a number"),
            (lambda q: q * 0.0 + np.inf, "is not a number"),
            (lambda q: q + 100.0, "the position of the path"),
            (lambda q: q + 0.5, "the speed of the path"),
            (lambda q: q + 0.005, "the acceleration of the path"),
        ],
    )
    def test_an_invalid_point_is_refused_before_the_robot_is_near_it(
        self, forward: OnlineFeedforward, spoil: Callable[[Points], Points], text: str
    ) -> None:
        path = waves(5, 600)
        path[400] = spoil(path[400])
        source = source_of(forward, path, end=False)
        points = drive(source)
        held_limits(points)
        assert source.stop is not None
        assert source.stop.code is StopCode.POINTS_REFUSED
        assert text in source.stop.text
        assert points[-1].sample_index < 400

    def test_a_torque_beyond_the_joints_limit_is_refused(self, forward: OnlineFeedforward) -> None:
        path = waves(6, 600, 1.0)
        speed = np.gradient(path, T, axis=0)
        model, parameters = true_model(CELL)
        needed = torque(model, path, speed, np.gradient(speed, T, axis=0), parameters)
        weak = np.array(forward.axes)
        weak[4, 0] = 0.95 * np.abs(needed[200:400, 0]).max()
        weak.setflags(
            write=False
        )  # as the original: a writeable array would compile the kernels again
        source = source_of(replace(forward, axes=weak), path, end=False)
        held_limits(drive(source))
        assert source.stop is not None
        assert source.stop.code is StopCode.POINTS_REFUSED

    def test_a_path_that_does_not_end_at_rest_is_refused_at_its_end(
        self, forward: OnlineFeedforward
    ) -> None:
        source = source_of(forward, waves(7, 500))
        held_limits(drive(source))
        assert source.stop is not None
        assert source.stop.code is StopCode.POINTS_REFUSED

    def test_an_error_of_the_feeder_is_reported(self, forward: OnlineFeedforward) -> None:
        ring = PointRing.create(3, 500)
        ring.write(waves(8, 500))
        ring.fail(PointsFailed.LOST, "the client hung up")
        source = PointSource(forward, ring, prefill_patience_s=0.0)
        source.prepare()
        source.begin(True, np.zeros(3))
        held_limits(drive(source))
        assert source.stop is not None
        assert source.stop.code is StopCode.POINTS_LOST
        assert source.stop.text.startswith("the client hung up.")


class TestStart:
    @pytest.mark.parametrize("count", [0, 1])
    def test_fewer_points_than_a_stop_needs_are_refused(
        self, forward: OnlineFeedforward, count: int
    ) -> None:
        with raises_code(DriverError, "RID-STREAM-POINTS"):
            source_of(forward, waves(1, 10)[:count], end=False, capacity=10)

    def test_a_path_that_does_not_start_at_rest_is_refused(
        self, forward: OnlineFeedforward
    ) -> None:
        with raises_code(ConfigError, "RID-STREAM-POINTS"):
            source_of(forward, waves(2, 500)[200:])

    def test_points_of_another_robot_are_refused(self, forward: OnlineFeedforward) -> None:
        with raises_code(ConfigError, "RID-MOTION-JOINTS"):
            PointSource(forward, PointRing.create(4, 10))


class TestFallback:
    def test_a_torque_that_is_not_a_number_falls_back_to_plain_feedforward(
        self, forward: OnlineFeedforward
    ) -> None:
        """One inertial parameter of a link in the model is NaN."""
        samples = planned()
        sound = forward.torque.arrays
        links = np.array(sound[3])
        links[2, 0] = np.nan
        torque_of = replace(forward.torque, arrays=(*sound[:3], links, *sound[4:]))
        source = source_of(replace(forward, torque=torque_of), samples.position)
        points = drive(source)
        held_limits(points)
        _, velocity, ahead = arrays(points)
        np.testing.assert_array_equal(velocity[40:], ahead[40:])
        assert "invalid model torque" in " ".join(source.notes)
        assert source.stop is None

    def test_a_late_cycle_fades_to_plain_feedforward_and_back(
        self, forward: OnlineFeedforward
    ) -> None:
        samples = planned()
        plain = drive(source_of(forward, samples.position))
        source = source_of(forward, samples.position)
        rows = [row for row in range(len(plain) + 1) if row != 200]
        points = drive(source, rows)
        by_row = dict(zip(rows, points, strict=False))
        assert by_row[201].position == plain[201].position, "the lost cycle delayed the path"
        faded, compensated = by_row[220], plain[220]
        assert faded.feedforward == faded.velocity
        assert compensated.feedforward != compensated.velocity
        assert by_row[300] == plain[300]
        assert "1 late cycles" in " ".join(source.notes)

    def test_a_correction_that_is_too_large_is_limited_without_wind_up(
        self, forward: OnlineFeedforward
    ) -> None:
        samples = planned()
        axes = np.array(forward.axes)
        axes[5] /= 40.0  # gains that request corrections forty times as large
        axes.setflags(write=False)
        source = source_of(replace(forward, axes=axes), samples.position)
        points = drive(source)
        held_limits(points)
        assert "correction that was too large" in " ".join(source.notes)


@settings(max_examples=600)
@given(
    stream=streams(),
    prefill=st.integers(0, 300),
    capacity=st.integers(20, 400),
    forward=st.sampled_from([FORWARD, REMEMBERING]),
)
@example(stream=(np.zeros((30, 3)), [], True, []), prefill=0, capacity=20, forward=FORWARD)
def test_set_points_keep_every_limit_and_come_to_rest_for_any_stream(
    stream: tuple[Points, list[int], bool, list[int]],
    prefill: int,
    capacity: int,
    forward: OnlineFeedforward,
) -> None:
    """Draw points that are random, discontinuous, late, incomplete or not finite."""
    path, pace, end, late = stream
    ring = PointRing.create(3, capacity)
    sent = ring.write(path[:prefill])
    source = PointSource(forward, ring, prefill_patience_s=0.0)
    try:
        source.prepare()
    except (ConfigError, DriverError):
        return  # nothing was moved
    source.begin(False, np.zeros(3))
    points: list[SetPoint] = []
    cycles: list[int] = []
    for row in range(5000):
        count = pace[row % len(pace)] if pace else 0
        sent += ring.write(path[sent : sent + count])
        if end and sent == len(path):
            ring.end()
        at = np.array(points[-1].position if points else path[0])
        source.watch(answers_at(at))
        if row in late:
            continue
        point = source.at(row)
        if point is None:
            break
        points.append(point)
        cycles.append(row)
    else:
        raise AssertionError("the axes never came to rest")
    if not late:
        held_limits(points)
    position, velocity, _ = arrays(points)
    gaps = np.diff(cycles, prepend=-1)[1:, np.newaxis]
    assert (np.abs(np.diff(velocity, axis=0)) <= gaps * ROUNDING * ACCELERATION * T).all()
    assert (np.abs(np.diff(position, axis=0)) <= gaps * ROUNDING * SPEED * T + 1e-9).all()
    assert not velocity[-1].any()
    assert (source.stop is None) == (source._counts[STATE] == ARRIVED)


def test_the_look_ahead_suits_the_slowest_loop(forward: OnlineFeedforward) -> None:
    assert forward.delay_cycles == int(CYCLES_TO_ACT) + 1
