"""Motion search for payload sessions."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError
from config.load import load_cell, load_robot
from config.robot.bodies import Plane, Workspace
from dynamics.geometry.clearances import Clearances
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import torque
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.payload.motion import LASTING_SHARE, PayloadSearch, design_payload_motion
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.012
PERIOD_S = 7.2


@pytest.fixture(scope="module")
def search() -> PayloadSearch:
    return PayloadSearch(load_robot("kr15"), PERIOD_S, CYCLE_S)


@pytest.fixture(scope="module")
def found(search: PayloadSearch) -> FourierMotion:
    return design_payload_motion(search, seed=1, periods=3, draws=100, steps=1000)


def objective_of(search: PayloadSearch, motion: FourierMotion) -> float:
    return search.objective(search.coefficients_of(motion))


def test_the_motion_determines_payloads_better_than_one_for_the_robot(
    search: PayloadSearch, found: FourierMotion
) -> None:
    general = design_two_harmonic(
        search.robot,
        TwoHarmonicOptions(PERIOD_S, highest_harmonic=6, limit_fraction=0.4, tries=20, seed=1),
        CYCLE_S,
    )
    # The objective is the logarithm of a variance: -1 is a factor of 0.6 in standard deviation.
    assert objective_of(search, found) < objective_of(search, general) - 1.0


def test_the_motion_keeps_its_fractions_of_the_limits(
    search: PayloadSearch, found: FourierMotion
) -> None:
    samples = found.plan(search.robot, CYCLE_S)
    for j, joint in enumerate(search.robot.joints):
        limits = joint.limits
        middle = 0.5 * (limits.position_max + limits.position_min)
        half = 0.5 * (limits.position_max - limits.position_min)
        assert np.abs(samples.position[:, j] - middle).max() <= search.position_share * half + 1e-4
        assert np.abs(samples.velocity[:, j]).max() <= search.speed_share * limits.velocity + 1e-4


def test_every_motor_keeps_its_continuous_torque(
    search: PayloadSearch, found: FourierMotion
) -> None:
    model = search.model.model
    samples = found.plan(search.robot, CYCLE_S)
    nm = torque(
        model,
        samples.position,
        samples.velocity,
        samples.acceleration,
        cad_parameters(model, search.robot)[0],
        search.conditions,
    )
    lasting = np.sqrt(np.mean(nm**2, axis=0))
    limits = np.array([joint.limits.torque for joint in search.robot.joints])
    assert (lasting <= 1.25 * LASTING_SHARE * limits).all()


def test_the_motion_keeps_the_clearance_of_the_workspace() -> None:
    robot = load_robot("kr15")
    floor = Plane(name="floor", normal=(0.0, 0.0, 1.0), offset_m=0.3)
    low = PayloadSearch(robot, PERIOD_S, CYCLE_S, workspace=Workspace(planes=(floor,)))
    motion = design_payload_motion(low, seed=2, periods=2, draws=60, steps=150)
    path = motion.plan(robot, CYCLE_S).position
    clearances = Clearances.of(robot, low.workspace)
    assert (clearances.nearest(path) >= clearances.margin_m).all()


def test_the_same_seed_gives_the_same_motion(search: PayloadSearch) -> None:
    done: list[int] = []

    def watch(count: int, total: int) -> None:
        assert total == 40
        done.append(count)

    one, again, other = (
        design_payload_motion(search, seed=seed, periods=2, draws=20, steps=20, watch=watch)
        for seed in (5, 5, 6)
    )
    assert set(done) == {*range(1, 41)}
    assert one == again
    assert one != other


def test_a_workspace_without_room_is_refused() -> None:
    wall = Plane(name="ceiling", normal=(0.0, 0.0, -1.0), offset_m=-0.4)
    with raises_code(ConfigError, "RID-DESIGN-NONE", "20"):
        design_payload_motion(
            PayloadSearch(
                load_robot("kr15"), PERIOD_S, CYCLE_S, workspace=Workspace(planes=(wall,))
            ),
            draws=20,
            steps=5,
        )
    with raises_code(ConfigError, "RID-OPTION-RANGE"):
        PayloadSearch(load_cell("kr15").robot, PERIOD_S, CYCLE_S, harmonics=1)
