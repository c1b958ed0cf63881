"""Known results on UR10e recordings: a change of the code must not change them unnoticed.

Positions are used as recorded, without interpolation between encoder steps.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from config.load import load_bundled_or_path, load_robot
from config.robot.robot import RobotDescription
from identification.choices import STANDSTILL_RAD_S
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.procedures import identify_payload
from identification.payload.smoothed_runs import SmoothedRuns
from identification.validation.robot_terms import with_friction

FIGURES = json.loads(Path(__file__).with_name("ur10e_figures.json").read_text())
CUTOFF_HZ = 9.4
LONG, SHORT = ("20_02_12-50sec_12harm", 355, 5090), ("20_02_10-30sec_12harm", 635, 3510)
UNLOADED, LOADED = ("20_01_31-unload", 300, 2623), ("20_01_31-load", 370, 2881)

Read = Callable[[tuple[str, int, int]], SmoothedSignals]


@pytest.fixture(scope="module")
def read(real_robot: Path) -> Read:
    layout = load_bundled_or_path("ur10e_31", "maps", ImportMap)
    alone = tuple(joint.model_copy(update={"velocity": None}) for joint in layout.joints)
    layout = layout.model_copy(update={"joints": alone})

    def signals(which: tuple[str, int, int]) -> SmoothedSignals:
        name, first, last = which
        rows = layout.model_copy(update={"rows": RowRange(first=first, last=last)})
        recording, _ = import_csv(real_robot / f"ur-{name}.csv", rows)
        return smooth_nonperiodic(recording, CUTOFF_HZ)

    return signals


@pytest.fixture(scope="module")
def ur10e() -> RobotDescription:
    return load_robot("ur10e")


def assert_unchanged(name: str, **found: object) -> None:
    """Compare results with the known ones, with a tolerance relative to the largest value."""
    for kind, values in found.items():
        before = np.array(FIGURES[name][kind], dtype=float)
        size = np.abs(before).max(initial=0.0)
        np.testing.assert_allclose(
            np.asarray(values, dtype=float), before, rtol=1e-9, atol=1e-9 * size, err_msg=kind
        )


def assert_estimate_unchanged(name: str, estimate: Estimate) -> None:
    assert_unchanged(
        name,
        values=estimate.values,
        sigma=estimate.sigma,
        residual_nm=estimate.residual_nm,
        nonlinear=estimate.options.nonlinear or (),
        nonlinear_sigma=estimate.nonlinear_sigma,
        condition_number=[estimate.condition_number],
    )


def test_estimate_of_two_motions(ur10e: RobotDescription, read: Read) -> None:
    assert_estimate_unchanged(
        "two motions", fit_smoothed(ur10e, [read(LONG), read(SHORT)]).estimate()
    )


def test_estimate_with_huber_weighting(ur10e: RobotDescription, read: Read) -> None:
    options = EstimationOptions(weighting="huber")
    assert_estimate_unchanged(
        "outliers held down", fit_smoothed(ur10e, [read(SHORT)], options).estimate()
    )


def test_estimate_with_nonlinear_friction(ur10e: RobotDescription, read: Read) -> None:
    robot = with_friction(ur10e, [("coulomb", "viscous", "offset", "load")] * 6)
    assert_estimate_unchanged("load friction", fit_smoothed(robot, [read(SHORT)]).estimate())


def test_estimate_with_a_payload_in_the_model(ur10e: RobotDescription, read: Read) -> None:
    options = EstimationOptions(model=ModelOptions(payload=True))
    signals = [read(UNLOADED), read(LOADED)]
    assert_estimate_unchanged(
        "payload", fit_smoothed(ur10e, signals, options, payload=[False, True]).estimate()
    )


def test_payload_estimate(ur10e: RobotDescription, read: Read) -> None:
    runs = SmoothedRuns((read(UNLOADED), read(LOADED)), (False, True), STANDSTILL_RAD_S)
    found = identify_payload(ur10e, runs)
    assert_unchanged(
        "weighed",
        values=found.values,
        sigma=found.sigma,
        residual_nm=found.residual_nm,
        condition_number=[found.condition_number],
    )
