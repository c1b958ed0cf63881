"""Mistakes in the description of a force plate are found.

They are not attributed to the torque constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.recording.recording import Recording
from config.cell.plate import CHANNEL_NAMES, PlateConfig
from identification.calibration.plate_equations import PlateEquations
from identification.calibration.plate_hypotheses import angles_of, rotation_of, wrench_matrix
from identification.calibration.plate_mistake import PlateKind, PlateMistake
from identification.calibration.plate_search import find_plate_mistake
from identification.calibration.torque_scale import torque_consistency
from identification.estimation.fitted_periods import FittedPeriods, fit_periodic, unsolved_equations
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import ModelKind
from identification.model.options import ModelOptions
from identification.regression.fit_grade import Grade, worst
from rid_daq.report.sections.plate import PlateSection
from tests.identification.conftest import SimulatedPlate

if TYPE_CHECKING:
    from config.load import LoadedCell
    from tests.identification.conftest import KnownArm

Channels = Callable[[Any], Any]
Fit = Callable[..., tuple[FittedPeriods, PlateConfig]]
Described = Callable[..., PlateMistake]
TURN = math.pi
EXTERNAL = EstimationOptions(model=ModelOptions(kind="external"))


def _as_they_are(channels: Any) -> Any:
    return channels


@pytest.fixture(scope="module")
def average(weigh: Callable[..., Recording]) -> PeriodAverage:
    return average_periods(weigh(3))


@pytest.fixture(scope="module")
def fit(average: PeriodAverage, arm: KnownArm) -> Fit:
    """Return a function that fits the recording with the given fields of `plate` and channels."""

    def fitted(
        kind: ModelKind = "external", channels: Channels = _as_they_are, **stated: object
    ) -> tuple[FittedPeriods, PlateConfig]:
        averages, plate = _described(average, channels, **stated)
        options = EstimationOptions(model=ModelOptions(kind=kind))
        return fit_periodic(arm.robot, averages, options), plate

    return fitted


@pytest.fixture(scope="module")
def find_mistake(average: PeriodAverage, arm: KnownArm) -> Described:
    """Return a function that finds the mistake from equations without estimated delays.

    A fit may refuse the estimated delays.
    """

    def found(kind: ModelKind, channels: Channels = _as_they_are, **stated: object) -> PlateMistake:
        averages, plate = _described(average, channels, **stated)
        options = EstimationOptions(model=ModelOptions(kind=kind))
        equations, model, base = unsolved_equations(arm.robot, averages, options)
        mistake = find_plate_mistake(averages, equations, [0.0], plate, arm.robot, model, base)
        assert mistake is not None
        return mistake

    return found


@pytest.mark.parametrize("kind", ["external", "combined"])
def test_a_correct_plate_is_graded_good_without_a_finding(fit: Fit, kind: ModelKind) -> None:
    fitted, plate = fit(kind)
    assert mistake_of(fitted, plate) is None
    estimate = fitted.estimate()
    assert estimate.plate is not None
    assert [each.grade for each in estimate.plate.grades] == [Grade.GOOD] * 6


@pytest.mark.parametrize("kind", ["external", "combined"])
@pytest.mark.parametrize(
    ("stated", "found", "right"),
    [
        ({"a_m": 0.15}, PlateKind.SIZE, (0.12,)),
        ({"b_m": 0.15}, PlateKind.SIZE, (0.2,)),
        ({"position_m": (0.32, -0.01, 0.03)}, PlateKind.POSITION, (0.02, -0.01, 0.03)),
        ({"position_m": (0.02, 0.04, 0.03)}, PlateKind.POSITION, (0.02, -0.01, 0.03)),
        ({"rotation_rad": (TURN, 0.0, 1.1)}, PlateKind.ROTATION, (0.0, 0.0, 0.4)),
        ({"rotation_rad": (0.0, 0.0, 0.4 - TURN)}, PlateKind.ROTATION, (0.0, 0.0, 0.4)),
        ({"rotation_rad": (0.0, 0.0, 0.05)}, PlateKind.ROTATION, (0.0, 0.0, 0.4)),
    ],
)
def test_a_wrong_size_position_or_rotation_is_found_with_its_value(
    find_mistake: Described, kind: ModelKind, stated: dict[str, Any], found: PlateKind, right: Any
) -> None:
    mistake = find_mistake(kind, **stated)
    assert (mistake.kind, mistake.key) == (found, next(iter(stated)))
    assert mistake.right == pytest.approx(right, abs=0.01)


@pytest.mark.parametrize("stated", [{"az0_m": -0.154}, {"position_m": (0.02, -0.01, 0.13)}])
def test_a_wrong_height_that_this_motion_does_not_show_is_not_named(
    average: PeriodAverage, arm: KnownArm, stated: dict[str, Any]
) -> None:
    averages, plate = _described(average, _as_they_are, **stated)
    equations, model, base = unsolved_equations(arm.robot, averages, EXTERNAL)
    condensed = PlateEquations.of(averages, equations, [0.0])
    assert condensed is not None
    assert condensed.shares(wrench_matrix(plate)).max() < 0.02
    assert find_plate_mistake(averages, equations, [0.0], plate, arm.robot, model, base) is None


@pytest.mark.parametrize("channel", [0, 2, 3, 5])
@pytest.mark.parametrize("factor", [1.2, 0.8, -1.0])
def test_a_wrong_channel_sensitivity_is_found(
    find_mistake: Described, channel: int, factor: float
) -> None:
    mistake = find_mistake("external", _times((channel,), factor))
    assert mistake.kind is PlateKind.SENSITIVITY
    assert mistake.right == pytest.approx((1.0 / factor,), rel=0.03)


@pytest.mark.parametrize("channels", [(0, 1), (0, 1, 2, 3), (4, 5, 6, 7), (0, 6, 7)])
def test_several_reversed_channels_are_found(
    find_mistake: Described, channels: tuple[int, ...]
) -> None:
    mistake = find_mistake("external", _times(channels, -1.0))
    assert mistake.right == (-1.0,) * len(channels)
    assert all(CHANNEL_NAMES[channel] in mistake.sentence for channel in channels)


@pytest.mark.parametrize("kind", ["external", "combined"])
@pytest.mark.parametrize("factor", [-1.0, 1e-4])
def test_a_common_factor_of_all_channels_is_found_by_the_arms_weight(
    find_mistake: Described, kind: ModelKind, factor: float
) -> None:
    mistake = find_mistake(kind, _times(tuple(range(8)), factor))
    assert (mistake.kind, len(mistake.right)) == (PlateKind.SENSITIVITY, 8)
    assert mistake.times_better == 1.0
    assert mistake.right[0] == -1.0 if factor < 0.0 else 0.3 < mistake.right[0] * factor < 3.0


@pytest.mark.parametrize(
    "order",
    [
        (1, 0, 2, 3, 4, 5, 6, 7),
        (0, 1, 2, 3, 5, 4, 6, 7),
        (2, 3, 0, 1, 4, 5, 6, 7),
        (7, 6, 5, 4, 3, 2, 1, 0),
        (4, 5, 6, 7, 0, 1, 2, 3),
        (0, 4, 2, 3, 1, 5, 6, 7),
    ],
)
def test_channels_in_another_order_are_found(
    find_mistake: Described, order: tuple[int, ...]
) -> None:
    mistake = find_mistake("external", lambda values: values[:, list(order)])
    moved = [i for i, other in enumerate(order) if i != other]
    assert (mistake.kind, mistake.stated) == (PlateKind.ORDER, tuple(moved))
    assert mistake.right == tuple(order[i] for i in moved)


def test_with_a_plate_mistake_torque_constants_are_not_blamed(fit: Fit) -> None:
    fitted, plate = fit("combined", b_m=0.15)
    estimate, mistake = fitted.estimate(), mistake_of(fitted, plate)
    assert estimate.plate is not None
    section = PlateSection.of(estimate.plate, (), None, torque_consistency(fitted), mistake)
    assert section.torque_constants is None
    assert section.mistake is not None
    assert (section.mistake.kind, section.mistake.key) == (PlateKind.SIZE, "b_m")


def test_an_impossible_wrench_is_graded_bad(fit: Fit) -> None:
    fitted, _ = fit("external", _times((2,), -1.0))
    estimate = fitted.estimate()
    assert estimate.plate is not None
    assert worst(estimate.plate.grades) is Grade.BAD
    assert PlateSection.of(estimate.plate, ()).bad_components


@pytest.mark.parametrize("angles", [(0.1, -0.4, 2.0), (0.3, math.pi / 2.0, 0.0), (TURN, 0.0, 0.2)])
def test_rotation_angles_are_those_of_a_cell_file(
    cell: LoadedCell, angles: tuple[float, float, float]
) -> None:
    assert cell.config.plate is not None
    rotation = rotation_of(cell.config.plate.model_copy(update={"rotation_rad": angles}))
    again = cell.config.plate.model_copy(update={"rotation_rad": angles_of(rotation)})
    np.testing.assert_allclose(rotation_of(again), rotation, atol=1e-5)


def mistake_of(fitted: FittedPeriods, plate: PlateConfig) -> PlateMistake | None:
    problem = fitted.problem
    delays_s = problem.delays_s.tolist()
    equations, model, base = fitted.equations, fitted.model, fitted.base
    return find_plate_mistake(
        problem.averages, equations, delays_s, plate, fitted.robot, model, base
    )


def _times(channels: tuple[int, ...], factor: float) -> Channels:
    factors = np.ones(8)
    factors[list(channels)] = factor
    return lambda values: values * factors


def _described(
    average: PeriodAverage, channels: Channels, **stated: object
) -> tuple[list[PeriodAverage], PlateConfig]:
    """Return the recording with the channels as wired, and the plate's description.

    Args:
        average: The correct recording.
        channels: Function that exchanges or scales the channels.
        stated: Fields of the description that differ from the true plate.
    """
    assert average.reaction is not None
    plate = SimulatedPlate().config.model_copy(update=stated)
    reaction = replace(
        average.reaction,
        base_wrench_matrix=PlateGeometry.from_config(plate).base_wrench_matrix,
        channels_n=channels(average.reaction.channels_n),
    )
    return [replace(average, reaction=reaction)], plate
