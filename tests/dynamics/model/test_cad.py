"""CAD data converted to standard parameters, compared with Pinocchio's parallel-axis theorem."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from config.errors import ConfigError
from config.load import load_robot
from config.robot.link_cad import LinkCad
from dynamics.model.cad import cad_parameters, cad_prior
from dynamics.model.robot_model import RobotModel
from tests.builders.raised_codes import raises_code

PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
LINK = LinkCad(
    mass_kg=4.0,
    centre_m=(0.1, -0.2, 0.3),
    inertia_kg_m2=(0.5, 0.02, -0.03, 0.6, 0.04, 0.4),
    uncertainty=0.2,
)
WEIGHTLESS = LinkCad(mass_kg=0.0)


@pytest.fixture
def robot(ir361):
    return ir361.model_copy(update={"cad": (WEIGHTLESS, LINK, LINK)})


def test_values_about_the_frames_origin_agree_with_pinocchio(robot) -> None:
    xx, xy, xz, yy, yz, zz = LINK.inertia_kg_m2
    body = pin.Inertia(
        LINK.mass_kg,
        np.array(LINK.centre_m),
        np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
    )
    values, _ = cad_parameters(RobotModel.from_description(robot), robot)
    expected = body.toDynamicParameters()[PINOCCHIO_ORDER]
    np.testing.assert_allclose(values[10:20], expected)
    np.testing.assert_allclose(values[20:30], expected)
    assert not values[:10].any()
    assert not values[30:].any()


def test_uncertainty_is_a_fraction_of_mass_moment_and_whole_inertia(robot) -> None:
    """An inertia element whose value is zero has an uncertainty too."""
    values, sigmas = cad_parameters(RobotModel.from_description(robot), robot)
    link, sigma = values[10:20], sigmas[10:20]
    assert sigma[0] == pytest.approx(0.2 * 4.0)
    np.testing.assert_allclose(sigma[1:4], 0.2 * 4.0 * np.linalg.norm(LINK.centre_m))
    np.testing.assert_allclose(sigma[4:], 0.2 * (link[4] + link[7] + link[9]) / 3.0)
    assert np.all(sigmas[:10] > 0.0)


def test_a_guess_has_values_but_is_not_a_prior(ir361) -> None:
    guess = LINK.model_copy(update={"uncertainty": None})
    some = ir361.model_copy(update={"cad": (guess, LINK, LINK)})
    values, sigmas = cad_prior(RobotModel.from_description(some), some)
    np.testing.assert_array_equal(values[:10], values[10:20])
    assert np.isinf(sigmas[:10]).all()
    assert np.isfinite(sigmas[10:30]).all()
    assert not some.is_drawn
    none = ir361.model_copy(update={"cad": (guess, guess, guess)})
    with raises_code(ConfigError, "RID-ROBOT-CAD"):
        cad_prior(RobotModel.from_description(none), none)


@pytest.mark.parametrize("moment", [0.0, 1e-6])
def test_zeros_in_cad_data_are_unknown_and_not_small(ir361, moment: float) -> None:
    """A wrist of 0.2 kg has an inertia of about 5e-4 kg m² about its centre.

    A file with three decimals states 0 for it, which must count as unknown.
    """
    flange = LinkCad(mass_kg=0.2, inertia_kg_m2=(moment, 0.0, 0.0, moment, 0.0, moment))
    wrist = ir361.model_copy(update={"cad": (LINK, LINK, flange)})
    _, sigmas = cad_parameters(RobotModel.from_description(wrist), wrist)
    assert np.all(sigmas[24:30] > 0.5 * 5e-4)
    assert np.all(sigmas[24:30] < 5.0 * 5e-4)


def test_inertias_of_real_links_are_accepted() -> None:
    assert all(cad.unknown_inertia_kg_m2 is None for cad in load_robot("ur10e").cad or ())


def test_friction_rotors_and_spring_are_unknown(robot) -> None:
    _, sigmas = cad_parameters(RobotModel.from_description(robot), robot)
    assert np.isfinite(sigmas[:30]).all()
    assert np.isinf(sigmas[30:]).all()


def test_the_bundled_ur10e_has_the_weight_of_its_data_sheet() -> None:
    robot = load_robot("ur10e")
    values, _ = cad_parameters(RobotModel.from_description(robot), robot)
    assert values[:60:10].sum() == pytest.approx(29.1, abs=0.1)


def test_a_robot_without_cad_data_is_refused(ir361) -> None:
    with raises_code(ConfigError, "RID-ROBOT-CAD"):
        cad_parameters(RobotModel.from_description(ir361), ir361)
