"""Presliding hysteresis, identified from the mean period of a periodic recording."""

from __future__ import annotations

import numpy as np
import pytest

from config.arrays import FloatArray
from config.load import to_yaml
from dynamics.model.robot_model import RobotModel, torque
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from rid_daq.app import run
from tests.builders.foreign_tables import as_lines, two_joint_map
from tests.builders.presliding_arm import COULOMB_NM, arm, iwan, with_presliding

pytestmark = pytest.mark.slow

PERIOD_S, STEP_S, PERIODS = 10.0, 0.01, 5
DISTANCES = {1: 0.02, 2: 0.008}
JOINTS = [{"joint": f"axis{j}", "position": j, "torque": 3 + j} for j in (1, 2, 3)]


def settled_periods() -> FloatArray:
    """Return times [s], positions [rad] and torques [N m] in columns, (rows, 7).

    Axes 2 and 3 have presliding hysteresis.
    """
    random = np.random.default_rng(5)
    times = STEP_S * np.arange(round(PERIODS * PERIOD_S / STEP_S))
    omega = 2.0 * np.pi / PERIOD_S * np.array([1.0, 2.0, 4.0, 7.0])
    size = np.array([0.35, 0.2, 0.1, 0.06])[:, np.newaxis] * random.uniform(0.7, 1.3, (4, 3))
    angle = np.multiply.outer(times, omega)[:, :, np.newaxis] + random.uniform(0.0, 6.3, (4, 3))
    rate = omega[:, np.newaxis]
    q = np.sum(size * np.sin(angle), axis=1)
    v = np.sum(size * rate * np.cos(angle), axis=1)
    a = -np.sum(size * rate**2 * np.sin(angle), axis=1)
    model = RobotModel.from_description(arm())
    values = np.random.default_rng(7).uniform(0.5, 1.0, len(model.parameter_names))
    values[model.parameter_groups["rotors"]] *= 1e-4
    values[model.parameter_groups["friction"]] = [COULOMB_NM, 8.0] * 3
    tau = torque(model, q, v, a, values)
    for joint, distance in DISTANCES.items():
        tau[:, joint] += COULOMB_NM * (iwan(q[:, joint], distance) - np.sign(v[:, joint]))
    tau += random.normal(0.0, 1.0, tau.shape)
    settled = round(PERIOD_S / STEP_S)  # after one period the initial state has no effect
    return np.column_stack([times, q, tau])[settled:]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Estimate:
    folder = tmp_path_factory.mktemp("periodic")
    (folder / "rec.csv").write_text("\n".join(as_lines(settled_periods())))
    (folder / "robot.yaml").write_text(to_yaml(with_presliding((1, 2), 0.004)))
    plausible = {"position": 10.0, "speed": 50.0, "torque": 5000.0}
    keys: dict[str, object] = {
        "robot": "robot.yaml",
        "joints": JOINTS,
        "plausible": plausible,
        "period_s": PERIOD_S,
    }
    (folder / "map.yaml").write_text(to_yaml(two_joint_map(**keys)))
    runs = ["--runs", str(folder / "runs")]
    words = ["import", str(folder / "rec.csv"), "--map", str(folder / "map.yaml")]
    assert run([*words, "--label", "periodic", *runs]) == 0
    assert run(["identify", "periodic", "-o", str(folder / "model.json"), *runs]) == 0
    return read_estimate(folder / "model.json")


def test_the_presliding_distances_are_identified(model: Estimate) -> None:
    assert model.method == "periodic"
    names = model.model.nonlinear_names
    assert names == ("dp_axis2", "dp_axis3")
    for value, sigma, truth in zip(
        model.model.nonlinear_values, model.nonlinear_sigma, DISTANCES.values(), strict=True
    ):
        assert value == pytest.approx(truth, abs=3.0 * sigma + 0.05 * truth)
        assert sigma < 0.2 * truth


def test_the_friction_is_identified_and_the_residuals_are_noise(model: Estimate) -> None:
    coulomb = [model.base.names.index(f"fc_axis{j}") for j in (1, 2, 3)]
    np.testing.assert_allclose(model.values[coulomb], COULOMB_NM, rtol=0.05)
    assert model.noise_nm is not None
    assert np.all(model.residual_nm < 1.2 * model.noise_nm)
