"""Simulated arm with presliding friction: identified, and streamed from rest.

The arm has bristle friction, the model a Maxwell-slip series. No value is taken from the plant.
"""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import yaml

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.tool_path import PathMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.periods import average_periods
from benchmarks.closed_loop import closed_loop
from benchmarks.paths import CIRCLES, FIRST, PATH, circle_text
from compensation.compensated_motion import compensated_motion
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.loops.velocity_loop import VelocityLoop
from compensation.online.online import OnlineFeedforward
from config.load import LoadedCell, load_cell, read_named
from dynamics.geometry.kinematics import Chain
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.validation.robot_terms import with_friction
from tests.builders.streamed_arm import stream_motion

pytestmark = pytest.mark.slow

PRESLIDING_RAD = 1e-3
FROM = ((0.10, -0.15, 0.20), (-0.30, 0.30, 0.60))
"""Poses of the arm before the path; from each, the joints approach in other directions."""


@pytest.fixture(scope="module")
def elastic(tmp_path_factory: pytest.TempPathFactory) -> LoadedCell:
    """The bundled cell with a plant file that has presliding on every axis."""
    folder = tmp_path_factory.mktemp("elastic")
    cell, _, _ = read_named("ir361", "cells", None)
    plant, _, _ = read_named("ir361", "plants", None)
    tree = yaml.safe_load(plant)
    for axis in tree["unmodelled"]["axes"]:
        axis["presliding_rad"] = PRESLIDING_RAD
    (folder / "plant.yaml").write_text(yaml.safe_dump(tree))
    named = re.sub("(?m)^plant: ir361$", "plant: plant.yaml", cell.decode())
    (folder / "cell.yaml").write_text(named)
    return load_cell(str(folder / "cell.yaml"))


@pytest.fixture(scope="module")
def models(elastic: LoadedCell) -> tuple[Estimate, Estimate]:
    """The arm identified with sign(v) friction, and identified with presliding hysteresis."""
    assert elastic.plant is not None
    options = TwoHarmonicOptions(10.0, tries=100, periods=8)
    motion = design_two_harmonic(elastic.robot, options, elastic.config.cycle_time_s)
    samples = motion.plan(elastic.robot, elastic.config.cycle_time_s)
    average = average_periods(closed_loop(elastic, elastic.plant, samples, 2))
    remembers = with_friction(
        elastic.robot, [(*joint.friction, "presliding") for joint in elastic.robot.joints]
    )
    plain, remembering = (
        fit_periodic(robot, [average]).estimate() for robot in (elastic.robot, remembers)
    )
    return plain, remembering


@pytest.fixture(scope="module")
def forwards(
    elastic: LoadedCell, models: tuple[Estimate, Estimate], loops: list[VelocityLoop]
) -> tuple[OnlineFeedforward, ...]:
    return tuple(
        OnlineFeedforward.from_model(elastic.config, elastic.robot, model, loops)
        for model in models
    )


def errors(
    elastic: LoadedCell,
    forwards: tuple[OnlineFeedforward, ...],
    samples: MotionSamples,
    start: tuple[float, ...],
) -> tuple[TrackingError, TrackingError, TrackingError]:
    """Return the path errors without compensation, with sign(v) friction, and with hysteresis."""
    by_sign, with_memory = forwards
    pose = np.array(start)
    return (
        stream_motion(elastic, by_sign, samples, start=pose, compensated=False),
        stream_motion(elastic, by_sign, samples, start=pose),
        stream_motion(elastic, with_memory, samples, start=pose),
    )


@pytest.mark.parametrize("start", FROM)
def test_the_error_of_lines_and_a_spline_from_rest_is_a_tenth(
    elastic: LoadedCell, forwards: tuple[OnlineFeedforward, ...], start: tuple[float, ...]
) -> None:
    path = PathMotion.model_validate_json(json.dumps(yaml.safe_load(PATH)))
    samples = path.plan(elastic.robot, elastic.config.cycle_time_s)
    plain, by_sign, with_memory = errors(elastic, forwards, samples, start)
    assert plain.mean_m > 1e-3
    assert with_memory.mean_m < plain.mean_m / 20.0
    assert with_memory.max_m < plain.max_m / 15.0
    assert with_memory.mean_m < by_sign.mean_m / 2.0
    assert with_memory.max_m < by_sign.max_m / 3.0


def test_off_line_the_hysteresis_state_follows_the_plan(
    elastic: LoadedCell, models: tuple[Estimate, Estimate], loops: list[VelocityLoop]
) -> None:
    """Only the mean error improves: the presliding state at the start is unknown."""
    assert elastic.plant is not None
    path = PathMotion.model_validate_json(json.dumps(yaml.safe_load(PATH)))
    samples = path.plan(elastic.robot, elastic.config.cycle_time_s)
    main = samples.phase == Phase.MAIN
    chain = Chain.from_description(elastic.robot)
    by_sign, with_memory = (
        tracking_error(
            chain,
            samples.position[main],
            closed_loop(elastic, elastic.plant, driven, 5).position[main],
        )
        for driven in (compensated_motion(samples, model, loops) for model in models)
    )
    assert with_memory.mean_m < by_sign.mean_m / 1.6


@pytest.mark.parametrize("title", [FIRST, "circle of 50 cm at 0.3 m/s"])
def test_the_error_of_circles_does_not_increase(
    elastic: LoadedCell, forwards: tuple[OnlineFeedforward, ...], title: str
) -> None:
    motion = CircleMotion.model_validate_json(circle_text(CIRCLES[title], 2))
    samples = motion.plan(elastic.robot, elastic.config.cycle_time_s)
    plain, by_sign, with_memory = errors(elastic, forwards, samples, FROM[0])
    assert with_memory.mean_m < min(plain.mean_m / 20.0, by_sign.mean_m / 1.5)
    assert with_memory.max_m < min(plain.max_m / 5.0, by_sign.max_m / 2.0)
