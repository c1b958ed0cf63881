"""Wrong arguments of the public functions: every refusal has a code and names the argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rid_daq.api
from config.errors import ConfigError
from rid_daq.api import Model, Recording
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm

api: Any = rid_daq.api  # the type checker would refuse what these tests try
Motion, compensate, design, identify = api.Motion, api.compensate, api.design, api.identify
identify_payload, read_recording = api.identify_payload, api.read_recording
retime, validate = api.retime, api.validate

ARGUMENT = "RID-API-ARGUMENT"
N = 200
TIME, TABLE = np.arange(N) * 0.01, np.zeros((N, 3))
POINTS = [[0.0, 0.0, 0.3], [0.1, 0.0, 0.3]]
Change = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("change", "code", "place"),
    [
        (lambda a: a.update(position=[["a"] * 3] * N), ARGUMENT, "position: "),
        (lambda a: a.update(torque_nm=[[1.0, 2.0], [3.0]]), ARGUMENT, "torque_nm: "),
        (lambda a: a.update(position=TABLE + 1j), ARGUMENT, "complex128"),
        (lambda a: a.update(velocity=[None] * N), ARGUMENT, "velocity: "),
        (lambda a: a.update(time_s=TIME.astype("m8[ms]")), ARGUMENT, "time_s: "),
        (lambda a: a.update(robot=361), ARGUMENT, "robot: "),
        (lambda a: a.update(period_s=-1.0), ARGUMENT, "period_s: -1.0"),
        (lambda a: a.update(period_s=np.float64(-0.0)), ARGUMENT, "period_s: -0.0 "),
        (lambda a: a.update(period_s=float("nan")), ARGUMENT, "period_s: nan"),
        (lambda a: a.update(name=3), ARGUMENT, "name: "),
        (lambda a: a.update(torques=np.array([1, 2])), ARGUMENT, "torques: "),
        (lambda a: a.update(name="a/b"), "RID-FILE-NAME", "'a/b'"),
        (lambda a: a.update(name="x" * 300), "RID-FILE-NAME", "'xxx"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(
    arm: Arm, change: Change, code: str, place: str
) -> None:
    arguments: dict[str, Any] = {
        "time_s": TIME,
        "position": TABLE,
        "torque_nm": TABLE,
        "robot": arm.robot,
    }
    change(arguments)
    with raises_code(ConfigError, code, place):
        Recording.from_arrays(**arguments)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_motion_that_is_not_finite_has_no_torques(model: Model, value: float) -> None:
    bad = np.zeros((4, 3))
    bad[2, 1] = value
    still = np.zeros((4, 3))
    for compute in (
        lambda: model.inverse_dynamics(still, still, bad),
        lambda: model.regressor(bad, still, still),
        lambda: model.mass_matrix(bad),
        lambda: model.friction(bad),
    ):
        with raises_code(ConfigError, ARGUMENT, f"[2, 1]: {value}"):
            compute()


@pytest.mark.parametrize(
    ("points", "speed", "place"),
    [
        ([[0.0, 0.0, 0.3], [np.nan, 0.0, 0.3]], 0.5, "0]: nan"),
        (POINTS, 50, "speed_fraction: 50"),
        (POINTS, float("nan"), "speed_fraction: nan"),
        (POINTS[:1], 0.5, "points: "),
        ([[0.0, 0.0, 0.3], [0.1]], 0.5, "points: "),
        ("abc", 0.5, "points: "),
    ],
)
def test_points_that_are_no_path_are_refused(points: Any, speed: float, place: str) -> None:
    with raises_code(ConfigError, ARGUMENT, place):
        Motion.through(points, cell="ir361", speed_fraction=speed)


@pytest.mark.parametrize(
    ("call", "place"),
    [
        (lambda m, r: identify(None), "recordings: "),
        (lambda m, r: identify([r, "second"]), "recordings[1]: "),
        (lambda m, r: identify(r, options=3), "options: "),
        (lambda m, r: identify(r, options={"choose": True}), "options: choose"),
        (lambda m, r: identify(r, robot=361), "robot: "),
        (lambda m, r: validate("model.json", r), "model: "),
        (lambda m, r: validate(m, "run"), "recording: "),
        (lambda m, r: validate(m, r, options={"run": "x"}), "options: run"),
        (lambda m, r: validate(m, r, limits_percent="30"), "limits_percent: "),
        (lambda m, r: validate(m, r, limits_percent=-3.0), "limits_percent: [-3.0]"),
        (lambda m, r: validate(m, r, limits_percent=float("nan")), "limits_percent: nan"),
        (lambda m, r: identify_payload("loaded"), "loaded: "),
        (lambda m, r: identify_payload(r, model="model.json"), "model: "),
        (lambda m, r: identify_payload(r, model=m, known={"m": 2.8}), "m: 2.8"),
        (lambda m, r: identify_payload(r, options={"known": ()}), "options: known"),
        (lambda m, r: m.with_payload(None), "payload None"),
        (lambda m, r: retime("path.yaml", m), "motion: "),
        (lambda m, r: retime(Motion.through(POINTS, cell="ir361"), "model.json"), "'model.json'"),
        (lambda m, r: compensate("path.yaml", m, "loops.json"), "motion: "),
        (lambda m, r: design("ir361", options={"excitation": 3}), "options: "),
        (lambda m, r: design("ir361", model="model.json"), "model: "),
        (lambda m, r: Motion.through(POINTS, cell=None), "cell: "),
        (lambda m, r: read_recording(None), "source: "),
        (lambda m, r: read_recording("a.csv", 3, map="ur10e_31"), "further[0]: "),
        (lambda m, r: read_recording("a.csv", map=3), "map: "),
        (lambda m, r: read_recording("a.csv", map="ur10e_31", rows=(1, 2)), "rows: "),
        (lambda m, r: read_recording("a.csv", map="ur10e_31", robot=10), "robot: "),
        (lambda m, r: identify(r, friction="viscous"), "friction: "),
        (lambda m, r: identify(r, friction=["viscous"], options={"how": 3}), "options.how: "),
        (lambda m, r: identify(r, friction=["viscous"], options={"how": {"options": "x"}}),
         "options.how.options: "),
        (lambda m, r: identify(r, friction=["viscous"], options={"how": {"options": {"model": {
            "friction_terms": ("coulomb",)}}}}), "friction: "),
        (lambda m, r: identify(r, progress=3), "progress: "),
        (lambda m, r: identify(r, options={1: 2}), "options: key: "),
        (lambda m, r: identify_payload(r, model=m, known=[2.8]), "known: "),
        (lambda m, r: m.with_payload(np.zeros(2)), "payload "),
        (lambda m, r: m.to_urdf(3), "urdf: "),
        (lambda m, r: m.to_urdf("arm.urdf", tip=[]), "tip: "),
        (lambda m, r: design("ir361", kind=np.zeros(2)), "kind: "),
        (lambda m, r: api.Robot.from_urdf("arm.urdf", packages=None), "packages: "),
        (lambda m, r: api.Robot.from_urdf("arm.urdf", parallelograms="a"), "parallelograms: "),
        (lambda m, r: api.Cell("ir361", 3).__enter__(), "service: "),
        (lambda m, r: api.Cell(3).__enter__(), "name: "),
        (lambda m, r: api.Cell("ir361", "https://localhost:1", "\ud800").__enter__(), "token: "),
    ],
)  # fmt: skip
def test_an_argument_of_a_wrong_type_or_range_is_refused_with_its_name(
    model: Model, train: Recording, call: Callable[[Model, Recording], object], place: str
) -> None:
    with raises_code(ConfigError, ARGUMENT, place):
        call(model, train)


@pytest.mark.parametrize("path", [None, 3, b"arm", [], "a\0b", "a" * 300, "\ud800"])
def test_a_path_that_names_no_file_is_refused(model: Model, path: Any) -> None:
    motion = Motion.through(POINTS, cell="ir361")
    uses: tuple[tuple[str, Callable[[], object]], ...] = (
        ("name: ", lambda: api.Robot.load(path)),
        ("path: ", lambda: api.Robot.from_urdf(path)),
        ("path: ", lambda: Model.load(path)),
        ("path: ", lambda: api.Payload.load(path)),
        ("path: ", lambda: Motion.load(path, cell="ir361")),
        ("source: ", lambda: api.propose_map(path, robot="ir361")),
        ("path: ", lambda: model.save(path)),
        ("path: ", lambda: motion.save(path)),
        ("loops: ", lambda: compensate(motion, model, path)),
        ("cell: ", lambda: Motion.through(POINTS, cell=path)),
    )
    for place, use in uses:
        with raises_code(ConfigError, ARGUMENT, place):
            use()


def test_limits_can_be_an_array(model: Model, arm: Arm) -> None:
    other = arm.recording(2)
    by_array = validate(model, other, limits_percent=np.full(3, 25.0))
    assert by_array.judged.verdict == validate(model, other, limits_percent=25.0).judged.verdict


def test_a_period_that_the_kind_of_motion_does_not_use_is_refused() -> None:
    with raises_code(ConfigError, "RID-OPTION-NO-EFFECT", "'multisine'"):
        design("ir361", kind="multisine", period_s=3.0)


def test_one_recording_does_not_count_as_two(model: Model, arm: Arm) -> None:
    once, again = arm.recording(2), arm.recording(2)  # equal data, imported twice
    for use in (
        lambda: identify([once, again], diagnose=False),
        lambda: validate(model, [once, again]),
        lambda: identify_payload(once, again),
    ):
        with raises_code(ConfigError, "RID-OPTION-EXCLUSIVE", str(len(once))):
            use()


def test_a_payload_is_not_computed_with_a_model_of_its_own_run(
    model: Model, train: Recording
) -> None:
    with raises_code(ConfigError, "RID-PAYLOAD-RUNS", str(train.run.folder.manifest().label)):
        identify_payload(train, model=model)
