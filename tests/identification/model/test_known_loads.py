"""Known bodies on any link: runs with them give the parameters of the robot alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from config.errors import ConfigError, EstimationError
from config.load import LoadedCell
from config.simulation.plant import LinkInertia, PlantConfig
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import build_model, fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.known_loads import Bodies, KnownBody, read_known_loads
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code
from tests.identification.conftest import KnownArm, Measure, SimulatedPlate

DISC = KnownBody(
    link=3, mass_kg=8.0, centre_m=(0.5, 0.03, 0.02), inertia_kg_m2=(0.03, 0.04, 0.05, 0, 0.01, 0)
)
COUNTERWEIGHT = KnownBody(
    link=2, mass_kg=12.0, centre_m=(-0.2, 0.05, 0.0), inertia_kg_m2=(0.08, 0.05, 0.06, 0.01, 0, 0)
)
LOADS: tuple[Bodies, ...] = ({}, {"disc": DISC}, {"disc": DISC, "counterweight": COUNTERWEIGHT})


def inertia_matrix(body: LinkInertia) -> NDArray[np.float64]:
    xx, yy, zz, xy, xz, yz = body.inertia_kg_m2
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def joined(link: LinkInertia, body: KnownBody) -> LinkInertia:
    """Return a link together with a body, about their common centre of gravity."""
    mass = link.mass_kg + body.mass_kg
    centre = (
        link.mass_kg * np.array(link.centre_m) + body.mass_kg * np.array(body.centre_m)
    ) / mass
    total = np.zeros((3, 3))
    for part in (link, body):
        r = np.array(part.centre_m) - centre
        total += inertia_matrix(part) + part.mass_kg * (r @ r * np.eye(3) - np.outer(r, r))
    (xx, xy, xz), (_, yy, yz), (*_, zz) = total.tolist()
    x, y, z = centre.tolist()
    return LinkInertia(mass_kg=mass, centre_m=(x, y, z), inertia_kg_m2=(xx, yy, zz, xy, xz, yz))


def carrying(cell: LoadedCell, bodies: Bodies) -> PlantConfig:
    """Return the simulated robot with bodies on its links."""
    assert cell.plant is not None
    links = list(cell.plant.links)
    for body in bodies.values():
        links[body.link - 1] = joined(links[body.link - 1], body)
    return cell.plant.without_unmodelled().model_copy(update={"links": tuple(links)})


@pytest.fixture(scope="module")
def recordings(cell: LoadedCell, arm: KnownArm) -> list[Recording]:
    """Runs of the simulated arm (Pinocchio) with each of the loads."""
    samples = arm.motion.plan(cell.robot, cell.config.cycle_time_s).whole()
    return [
        closed_loop(cell, carrying(cell, bodies), samples, seed)
        for seed, bodies in enumerate(LOADS)
    ]


def deviations(estimate: Estimate, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.abs(estimate.values - truth) / estimate.sigma)


def test_periodic_runs_with_known_bodies_give_the_robot_alone(
    arm: KnownArm, recordings: list[Recording]
) -> None:
    averages = [average_periods(each) for each in recordings]
    found = fit_periodic(arm.robot, averages, bodies=LOADS).estimate()
    assert deviations(found, arm.base).max() < 4.0
    assert np.mean(deviations(found, arm.base) < 2.0) >= 0.85
    ignored = fit_periodic(arm.robot, averages).estimate()
    assert (ignored.residual_nm > 5.0 * found.residual_nm).any()


def test_known_bodies_narrow_the_intervals_of_a_run_alone(
    arm: KnownArm, recordings: list[Recording]
) -> None:
    averages = [average_periods(each) for each in recordings]
    alone = fit_periodic(arm.robot, averages[:1]).estimate()
    together = fit_periodic(arm.robot, averages, bodies=LOADS).estimate()
    assert alone.sigma_noise is not None
    assert together.sigma_noise is not None
    assert (together.sigma_noise < alone.sigma_noise).all()


def test_runs_that_are_not_periodic_give_the_robot_alone(
    arm: KnownArm, recordings: list[Recording]
) -> None:
    signals = [
        smoothed_recording(replace(each, samples_per_period=None), 10.0) for each in recordings
    ]
    found = fit_smoothed(arm.robot, signals, bodies=LOADS).estimate()
    only = fit_smoothed(arm.robot, signals[:1]).estimate()
    off, own = (np.abs(each.values - arm.base) for each in (found, only))
    assert (off < 5.0 * found.sigma + own).all()
    assert (found.residual_nm < 1.5 * only.residual_nm).all()


def test_a_force_plate_gives_the_robot_alone(
    arm: KnownArm, cell: LoadedCell, measure: Measure
) -> None:
    kind = EstimationOptions(model=ModelOptions(kind="combined"))
    averages = []
    for seed, bodies in enumerate(LOADS):
        loaded = replace(cell, plant=carrying(cell, bodies))
        assert loaded.plant is not None
        values = true_parameters(RobotModel.from_description(cell.robot), cell.robot, loaded.plant)
        plain = measure(seed, periods=16, parameters=values)
        averages.append(average_periods(SimulatedPlate().weigh(loaded, arm.motion, plain, seed)))
    found = fit_periodic(arm.robot, averages, kind, bodies=LOADS).estimate()
    model, base, *_ = build_model(arm.robot, ModelOptions(kind="combined"))
    assert cell.plant is not None
    truth = base.from_standard(true_parameters(model, cell.robot, cell.plant))
    assert deviations(found, truth).max() < 4.0
    assert found.plate is not None
    assert (found.plate.residual < 1.5 * found.plate.noise).all()


def test_friction_that_depends_on_the_load_is_refused(
    arm: KnownArm, recordings: list[Recording]
) -> None:
    joints = tuple(
        joint.model_copy(update={"friction": (*joint.friction, "load")})
        for joint in arm.robot.joints
    )
    robot = arm.robot.model_copy(update={"joints": joints})
    averages = [average_periods(each) for each in recordings[:2]]
    with raises_code(EstimationError, "RID-MODEL-LOAD-FRICTION"):
        fit_periodic(robot, averages, bodies=LOADS[:2])


FILE = """\
bodies:
  disc: {link: 3, mass_kg: 8.0, mass_sigma_kg: 0.01, centre_m: [0.5, 0.03, 0.02],
         inertia_kg_m2: [0.03, 0.04, 0.05, 0.0, 0.01, 0.0]}
loads:
- {run: four, bodies: [disc]}
"""


def write_loads(folder: Path, *changes: tuple[str, str]) -> Path:
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "loads.yaml"
    path.write_text(text)
    return path


def test_a_file_names_bodies_and_the_runs_that_carried_them(tmp_path: Path, arm: KnownArm) -> None:
    loads = read_known_loads(write_loads(tmp_path), arm.robot)
    assert loads.bodies["disc"].link == 3
    assert loads.bodies["disc"].mass_sigma_kg == 0.01
    assert [(each.run, each.bodies) for each in loads.loads] == [("four", ("disc",))]
    np.testing.assert_allclose(loads.bodies["disc"].parameters, DISC.parameters)


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ([("bodies: [disc]", "bodies: [disk]")], "RID-FILE-VALUE", ["disk", "four"]),
        ([("[disc]", "[disc, disc]")], "RID-FILE-VALUE", ["four", "twice"]),
        ([("sigma_kg: 0.01", "sigma_kg: 10.0")], "RID-FILE-VALUE", ["mass_sigma_kg", "10", "8"]),
        ([("link: 3", "link: 4")], "RID-FILE-VALUE", ["disc", "link 4", "3 links"]),
        ([("link: 3", "link: 0")], "RID-FILE-VALUE", ["link"]),
        ([("mass_kg: 8.0", "mass_kg: 8000.0")], "RID-FILE-VALUE", ["mass_kg"]),
        ([("0.05, 0.0", "5.0, 0.0")], "RID-FILE-VALUE", ["inertia_kg_m2"]),
    ],
)
def test_an_impossible_file_is_refused(
    tmp_path: Path,
    arm: KnownArm,
    changes: Sequence[tuple[str, str]],
    code: str,
    words: Sequence[str],
) -> None:
    with raises_code(ConfigError, code, *words):
        read_known_loads(write_loads(tmp_path, *changes), arm.robot)
