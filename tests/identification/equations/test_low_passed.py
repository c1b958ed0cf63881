"""Low-passed columns of terms without nonlinear parameters are cached.

Cached columns equal new ones.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from config.arrays import FloatArray
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.memory import with_presliding_history
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.equations import low_passed
from identification.equations.low_passed import ColumnCache, LowPassedColumns
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.torque_columns import torque_columns
from identification.validation.robot_terms import with_friction, with_presliding
from tests.builders.presliding_arm import CUTOFF_HZ, STEP_S, arm, motion, signals_of

WAY = motion(4.0, 3)
ROWS = slice(0, len(WAY[0]))
TERMS: dict[str, tuple[FrictionTerm, ...]] = {
    "classical": ("coulomb", "viscous", "offset"),
    "stribeck": ("coulomb", "viscous", "stribeck"),
    "asymmetric": ("asymmetric", "viscous", "cube_root"),
    "temperature": ("coulomb", "viscous", "temperature"),
    "load": ("coulomb", "viscous", "load"),
}


def robot_of(name: str) -> RobotDescription:
    """Return the arm with the given terms and presliding in joints 1 and 3."""
    return with_presliding(with_friction(arm(), [TERMS[name]] * 3), (0.01, None, 0.02))


def recording() -> SmoothedSignals:
    return signals_of(*WAY, np.zeros_like(WAY[0]))


def cached_and_fresh(
    model: RobotModel, base: BaseParameters, kept: ColumnCache, standard: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    warm = np.tile(300.0 + np.linspace(0.0, 5.0, len(WAY[0]))[:, np.newaxis], (1, 3))
    conditions = with_presliding_history(model, WAY[0], Conditions(temperature_k=warm))
    columns = LowPassedColumns(model, base, recording(), conditions, standard, kept)
    fresh = torque_columns(model, base, WAY, conditions, standard)
    return columns.of(ROWS, 3), low_pass(fresh, STEP_S, CUTOFF_HZ)[::3]


@pytest.mark.parametrize("name", list(TERMS))
def test_cached_columns_equal_fresh_ones(name: str) -> None:
    model = RobotModel.from_description(robot_of(name))
    base, kept = base_parameters(model), ColumnCache()
    random = np.random.default_rng(2)
    low, high = model.nonlinear_bounds.T
    for share in (None, 0.1, 0.7, 0.3):
        standard = None
        if share is not None:
            model = model.with_nonlinear(low + share * (high - low))
            standard = base.to_standard(random.normal(size=len(base)))
        by_kept, fresh = cached_and_fresh(model, base, kept, standard)
        np.testing.assert_allclose(by_kept, fresh, atol=1e-10 * np.abs(fresh).max())
    # gear losses change everything that the gear transmits
    assert bool(kept.blocks) == (name != "load")


def test_another_model_clears_the_cache() -> None:
    kept = ColumnCache()
    for name in ("classical", "stribeck", "classical"):
        model = RobotModel.from_description(robot_of(name))
        by_kept, fresh = cached_and_fresh(model, base_parameters(model), kept, None)
        np.testing.assert_allclose(by_kept, fresh, atol=1e-10 * np.abs(fresh).max())
        assert kept.chain is model.chain


def test_without_memory_nothing_is_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(low_passed, "MOST_BYTES", 1000)
    model = RobotModel.from_description(robot_of("classical"))
    base, kept = base_parameters(model), ColumnCache()
    for _ in range(2):
        by_kept, fresh = cached_and_fresh(model, base, kept, None)
        np.testing.assert_allclose(by_kept, fresh, atol=1e-10 * np.abs(fresh).max())
    assert not kept.blocks
