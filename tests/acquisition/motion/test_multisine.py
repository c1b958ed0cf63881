"""Multisines: separate spectral lines for each joint, low crest factors, no energy elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.multisine import (
    LEAST_SLOW,
    MultisineMotion,
    crest_factor,
    low_crest_factor,
)
from acquisition.motion.samples import Phase
from config.errors import ConfigError
from config.load import load_robot
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code, raises_invalid

STEP_S = 0.008
PERIOD_S = 8.0


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_robot("ir361")


def multisine(**changes: object) -> MultisineMotion:
    joints = tuple(
        {"joint": name, "velocity": 0.03, "slow_amplitude": 0.2}
        for name in ("axis1", "axis2", "axis3")
    )
    fields = {
        "kind": "multisine",
        "robot": "ir361",
        "period_s": PERIOD_S,
        "lowest_hz": 0.5,
        "highest_hz": 20.0,
        "grid": "random_odd",
        "joints": joints,
    }
    return MultisineMotion.model_validate(fields | changes)


@pytest.mark.parametrize("grid", ["odd", "random_odd", "full"])
def test_no_two_joints_share_a_spectral_line(robot: RobotDescription, grid: str) -> None:
    lines = multisine(grid=grid).excited_lines(robot)
    every = np.concatenate(lines)
    assert len(set(every.tolist())) == len(every)
    assert every.min() >= 0.5 * PERIOD_S
    assert every.max() <= 20.0 * PERIOD_S
    if grid != "full":
        assert (every % 2 == 1).all()
    odd = np.arange(5, 161, 2)
    empty = sorted(set(odd.tolist()) - set(every.tolist()))
    assert len(empty) == (len(odd) // 4 if grid == "random_odd" else 0)


def test_the_velocity_of_a_realisation_is_on_its_lines_alone(robot: RobotDescription) -> None:
    motion = multisine()
    lines, phasors = motion.excited_lines(robot), motion.speed_phasors(robot)
    samples = motion.plan(robot, STEP_S)
    main = np.flatnonzero(samples.phase == Phase.MAIN)
    rows = round(PERIOD_S / STEP_S)
    for number in range(motion.realisations):
        first = main[number * motion.periods * rows]
        bins = 2.0 * np.fft.rfft(samples.velocity[first : first + rows], axis=0) / rows
        for joint in range(3):
            np.testing.assert_allclose(bins[lines[joint], joint], phasors[joint][number], atol=1e-9)
            others = np.delete(np.abs(bins[:, joint]), [1, *lines[joint]])
            assert others.max() < 1e-9
            slow = abs(bins[1, joint]) / (0.2 * 2.0 * np.pi / PERIOD_S)
            assert LEAST_SLOW <= slow <= 1.0
            rms = np.sqrt(np.sum(np.abs(bins[lines[joint], joint]) ** 2) / 2.0)
            assert rms == pytest.approx(0.03)
    assert samples.samples_per_period is None
    assert len(main) == motion.realisations * motion.periods * rows


def test_realisations_differ_and_are_reproduced_by_the_seed(robot: RobotDescription) -> None:
    first, second, *_ = multisine().realisation_motions(robot)
    assert first != second
    assert multisine().realisation_motions(robot)[0] == first
    assert multisine(seed=1).realisation_motions(robot)[0] != first


def test_a_joint_that_is_not_measured_has_crest_factor_0(robot: RobotDescription) -> None:
    joints = [joint.model_dump() for joint in multisine().joints]
    joints[1]["velocity"] = 0.0
    first, second, third = multisine(joints=tuple(joints)).crest_factors(robot)
    assert second == 0.0
    assert min(first, third) > 1.0


def test_the_crest_factor_is_low() -> None:
    lines = np.arange(3, 81, 2)
    time = np.arange(4096) / 4096
    random = np.random.default_rng(0)

    def crest(phasors: np.ndarray) -> float:
        return crest_factor(np.real(np.exp(2j * np.pi * np.outer(time, lines)) @ phasors))

    start = [np.exp(1j * random.uniform(0.0, 2.0 * np.pi, len(lines))) for _ in range(8)]
    before = [crest(phasors) for phasors in start]
    after = [crest(low_crest_factor(lines, phasors)) for phasors in start]
    assert np.median(before) > 2.6
    assert max(after) < 2.1
    for phasors in start:
        np.testing.assert_allclose(np.abs(low_crest_factor(lines, phasors)), 1.0)
    schroeder = np.exp(-1j * np.pi * np.arange(len(lines)) * np.arange(1, len(lines) + 1) / 39)
    assert crest(schroeder) < 2.0


@pytest.mark.parametrize(
    ("changes", "code", "details"),
    [
        (
            {"lowest_hz": 19.9, "highest_hz": 20.0},
            "RID-MOTION-BAND",
            ("19.9 to 20 Hz", "0 lines", "'axis1'"),
        ),
        (
            {"joints": ({"joint": "axis1", "velocity": 0.1},)},
            "RID-MOTION-JOINTS",
            ("axis1, axis2, axis3",),
        ),
    ],
)
def test_an_invalid_multisine_is_refused(
    robot: RobotDescription, changes: dict[str, object], code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        multisine(**changes).excited_lines(robot)


def test_the_slow_sine_is_not_on_a_spectral_line() -> None:
    with raises_invalid("", "lowest_hz", "2 / period_s"):
        multisine(lowest_hz=0.125)
