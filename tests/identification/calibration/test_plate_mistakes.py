"""A force plate that is described wrongly is named, and not the torque constants."""

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
from config.cell.plate import PlateConfig
from identification.calibration.plate_mistake import PlateKind, PlateMistake
from identification.calibration.plate_search import _angles, _rotation, find_plate_mistake
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


def _as_they_are(channels: Any) -> Any:
    return channels


@pytest.fixture(scope="module")
def average(weigh: Callable[..., Recording]) -> PeriodAverage:
    return average_periods(weigh(3))


@pytest.fixture(scope="module")
def fit(average: PeriodAverage, arm: KnownArm) -> Fit:
    """Fit the recording with fields of `plate` as stated, and channels as wired."""

    def fitted(
        kind: ModelKind = "external", channels: Channels = _as_they_are, **stated: object
    ) -> tuple[FittedPeriods, PlateConfig]:
        averages, plate = _described(average, channels, **stated)
        options = EstimationOptions(model=ModelOptions(kind=kind))
        return fit_periodic(arm.robot, averages, options), plate

    return fitted


@pytest.fixture(scope="module")
def described(average: PeriodAverage, arm: KnownArm) -> Described:
    """Find the mistake by equations before delays are known: a fit may refuse its delay."""

    def found(kind: ModelKind, channels: Channels = _as_they_are, **stated: object) -> PlateMistake:
        averages, plate = _described(average, channels, **stated)
        options = EstimationOptions(model=ModelOptions(kind=kind))
        equations = unsolved_equations(arm.robot, averages, options)
        mistake = find_plate_mistake(averages, equations, [0.0], plate)
        assert mistake is not None
        return mistake

    return found


@pytest.mark.parametrize("kind", ["external", "combined"])
def test_a_plate_as_it_is_is_good_and_nothing_is_found(fit: Fit, kind: ModelKind) -> None:
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
        ({"rotation_rad": (0.0, 0.0, 0.4 - TURN)}, PlateKind.ROTATION, (0.0, 0.0, 0.4)),
        ({"rotation_rad": (0.0, 0.0, 0.05)}, PlateKind.ROTATION, (0.0, 0.0, 0.4)),
    ],
)
def test_a_size_a_place_or_a_direction_is_found_with_its_value(
    described: Described, kind: ModelKind, stated: dict[str, Any], found: PlateKind, right: Any
) -> None:
    mistake = described(kind, **stated)
    assert (mistake.kind, mistake.key) == (found, next(iter(stated)))
    assert mistake.right == pytest.approx(right, abs=0.01)


@pytest.mark.parametrize("channel", [0, 2, 5])
@pytest.mark.parametrize("factor", [1.2, -1.0])
def test_a_channels_sensitivity_is_found(described: Described, channel: int, factor: float) -> None:
    mistake = described("external", _times(channel, factor))
    assert mistake.kind is PlateKind.SENSITIVITY
    assert mistake.right == pytest.approx((1.0 / factor,), rel=0.03)


@pytest.mark.parametrize("pair", [(0, 1), (4, 5)])
def test_channels_that_are_swapped_are_found(described: Described, pair: tuple[int, int]) -> None:
    order = list(range(8))
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    mistake = described("external", lambda values: values[:, order])
    assert (mistake.kind, mistake.stated) == (PlateKind.ORDER, pair)


def test_a_mistaken_plate_keeps_torque_constants_out_of_suspicion(fit: Fit) -> None:
    fitted, plate = fit("combined", b_m=0.15)
    estimate, mistake = fitted.estimate(), mistake_of(fitted, plate)
    assert estimate.plate is not None
    section = PlateSection.of(estimate.plate, (), None, torque_consistency(fitted), mistake)
    assert section.torque_constants is None
    assert section.mistake is not None
    assert (section.mistake.kind, section.mistake.key) == (PlateKind.SIZE, "b_m")


def test_a_wrench_that_no_robot_has_is_graded_bad(fit: Fit) -> None:
    fitted, _ = fit("external", _times(2, -1.0))
    estimate = fitted.estimate()
    assert estimate.plate is not None
    assert worst(estimate.plate.grades) is Grade.BAD
    assert PlateSection.of(estimate.plate, ()).bad_components


@pytest.mark.parametrize("angles", [(0.1, -0.4, 2.0), (0.3, math.pi / 2.0, 0.0), (TURN, 0.0, 0.2)])
def test_angles_are_those_of_a_cell_file(
    cell: LoadedCell, angles: tuple[float, float, float]
) -> None:
    assert cell.config.plate is not None
    rotation = _rotation(cell.config.plate.model_copy(update={"rotation_rad": angles}))
    again = cell.config.plate.model_copy(update={"rotation_rad": _angles(rotation)})
    np.testing.assert_allclose(_rotation(again), rotation, atol=1e-5)


def mistake_of(fitted: FittedPeriods, plate: PlateConfig) -> PlateMistake | None:
    problem = fitted.problem
    delays_s = problem.delays_s.tolist()
    return find_plate_mistake(problem.averages, fitted.equations, delays_s, plate)


def _times(channel: int, factor: float) -> Channels:
    factors = np.ones(8)
    factors[channel] = factor
    return lambda values: values * factors


def _described(
    average: PeriodAverage, channels: Channels, **stated: object
) -> tuple[list[PeriodAverage], PlateConfig]:
    """Return a recording of channels as wired, by a plate with these fields."""
    assert average.reaction is not None
    plate = SimulatedPlate().config.model_copy(update=stated)
    reaction = replace(
        average.reaction,
        base_wrench_matrix=PlateGeometry.from_config(plate).base_wrench_matrix,
        channels_n=channels(average.reaction.channels_n),
    )
    return [replace(average, reaction=reaction)], plate
