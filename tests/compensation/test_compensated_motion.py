"""From excitation to a compensated circle, with all values measured on the simulated arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.recording import Recording
from compensation.compensated_motion import compensated_motion
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.loops.loop_file import read_loops, write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.load import LoadedCell
from dynamics.geometry.kinematics import Chain
from identification.estimation.estimate import Estimate
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Drive = Callable[..., Recording]


def circle(centre: tuple[float, float, float], radius_m: float, speed: float) -> CircleMotion:
    return CircleMotion(
        kind="circle",
        robot="ir361",
        centre_m=centre,
        radius_m=radius_m,
        speed_m_s=speed,
        near=(0.1, -0.1, 0.4),
        periods=4,
    )


def error_of(cell: LoadedCell, drive: Drive, samples: MotionSamples) -> TrackingError:
    recording = drive(samples, 5)
    main = samples.phase == Phase.MAIN
    chain = Chain.from_description(cell.robot)
    return tracking_error(chain, samples.position[main], recording.position[main])


@pytest.mark.parametrize(
    ("centre", "radius_m", "speed", "mean_ratio", "max_ratio"),
    [
        ((0.575, -0.078, -1.724), 0.20, 0.6, 10.0, 6.0),
        ((0.600, 0.100, -1.600), 0.10, 0.4, 6.0, 4.0),
        ((0.650, -0.100, -1.650), 0.12, 0.5, 6.0, 4.0),
    ],
)
def test_the_error_of_circles_falls_by_an_order_of_magnitude(
    cell: LoadedCell,
    drive: Drive,
    loops: list[VelocityLoop],
    model: Estimate,
    centre: tuple[float, float, float],
    radius_m: float,
    speed: float,
    mean_ratio: float,
    max_ratio: float,
) -> None:
    """All unmodelled effects are on, and no value is taken from the plant."""
    samples = circle(centre, radius_m, speed).plan(cell.robot, cell.config.cycle_time_s).whole()
    before = error_of(cell, drive, samples)
    after = error_of(cell, drive, compensated_motion(samples, model, loops))
    assert before.mean_m > 5e-4
    assert after.mean_m < before.mean_m / mean_ratio
    assert after.max_m < before.max_m / max_ratio


def test_a_motion_that_is_not_periodic_is_compensated(
    cell: LoadedCell, drive: Drive, loops: list[VelocityLoop], model: Estimate
) -> None:
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=6, seed=1)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    before = error_of(cell, drive, samples)
    after = error_of(cell, drive, compensated_motion(samples, model, loops))
    assert after.mean_m < before.mean_m / 5.0


def test_the_feedforward_has_no_jump_between_run_in_period_and_run_out(
    cell: LoadedCell, loops: list[VelocityLoop], model: Estimate
) -> None:
    motion = circle((0.575, -0.078, -1.724), 0.2, 0.6)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s).whole()
    ahead = compensated_motion(samples, model, loops).feedforward
    assert ahead is not None
    steps = np.abs(np.diff(ahead, axis=0))
    main = samples.phase[1:] == Phase.MAIN
    assert (steps[~main].max(axis=0) < 1.5 * steps[main].max(axis=0) + 0.01).all()
    rows = samples.samples_per_period or 0
    first = int(np.flatnonzero(samples.phase == Phase.MAIN)[0])
    np.testing.assert_array_equal(
        ahead[first : first + rows], ahead[first + rows : first + 2 * rows]
    )


def test_loops_are_read_back_from_their_file(
    loops: list[VelocityLoop], tmp_path: Path, cell: LoadedCell
) -> None:
    path = tmp_path / "loops.json"
    write_loops(path, loops, "ir361", "run", "lab")
    file, found = read_loops(path)
    assert (file.robot, file.run, file.cell) == ("ir361", "run", "lab")
    for loop, again in zip(loops, found, strict=True):
        assert again.gain == loop.gain
        assert again.integral_time_s == loop.integral_time_s
        np.testing.assert_array_equal(again.covariance, loop.covariance)
    path.write_text("{}")
    with raises_code(ConfigError, "RID-FILE-VALUE", f"{path}: ", "`rid-daq loop`", "format:"):
        read_loops(path)
    with raises_code(ConfigError, "RID-FILE-READ", "none.json: "):
        read_loops(tmp_path / "none.json")


def test_loops_and_models_of_other_joints_are_refused(
    cell: LoadedCell, loops: list[VelocityLoop], model: Estimate
) -> None:
    motion = circle((0.575, -0.078, -1.724), 0.2, 0.6)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    with raises_code(ConfigError, "RID-LOOP-MISSING", "axis1"):
        compensated_motion(samples, model, loops[1:])
    others = replace(samples, joint_names=("a", "b", "c"))
    with raises_code(ConfigError, "RID-ROBOT-OTHER", "axis1", "b"):
        compensated_motion(others, model, loops)


def test_a_circle_takes_a_whole_number_of_cycles(cell: LoadedCell) -> None:
    turns = circle((0.575, -0.078, -1.724), 0.2, 0.6).as_fourier(cell.robot, 0.008)
    assert turns.period_s == pytest.approx(2.096)
