"""Choosing friction terms by cross-validation, on arms whose friction is known.

`ExhaustiveTrials` fits every candidate from the rows, as the first version did: the slow reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from benchmarks.choose import ExhaustiveTrials
from config.errors import EstimationError
from config.load import load_robot
from dynamics.model.robot_model import RobotModel, torque
from identification.equations.segments import cut
from identification.estimation.options import EstimationOptions
from identification.validation.friction_selection import (
    CLASSICAL,
    Comparison,
    choose_friction,
    select,
)
from identification.validation.friction_trials import (
    CondensedTrials,
    Terms,
    Trial,
    with_friction,
)

Joints = tuple[Terms, ...]

TRUTH: Joints = (CLASSICAL, (*CLASSICAL, "offset", "cubic"), (*CLASSICAL, "offset", "cube_root"))
CANDIDATES = (
    CLASSICAL,
    (*CLASSICAL, "offset"),
    (*CLASSICAL, "offset", "cubic"),
    (*CLASSICAL, "offset", "cube_root"),
    (*CLASSICAL, "offset", "cube_root", "cubic"),
)


def recording(
    terms: Joints, samples: int, noise_nm: float = 1.0, nonlinear: tuple[float, ...] = ()
) -> SmoothedSignals:
    """Return a motion of the bundled arm with these terms of friction."""
    robot = with_friction(load_robot("ir361"), terms)
    model = RobotModel.from_description(robot).with_nonlinear(nonlinear)
    random = np.random.default_rng(1)
    values = random.uniform(0.5, 1.0, len(model.parameter_names))
    friction = model.parameter_groups["friction"]
    values[friction] *= 20.0
    time_s = 0.01 * np.arange(samples, dtype=np.float64)
    omega = 2.0 * np.pi / 20.0 * np.arange(1, 8)
    sine, cosine = 0.3 * random.normal(size=(2, 7, 3))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    return SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=torque(model, q, v, a, values) + noise_nm * random.normal(size=q.shape),
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=0.01,
        cutoff_hz=10.0,
    )


@pytest.fixture(scope="module")
def signals() -> SmoothedSignals:
    return recording(TRUTH, 6000)


@pytest.fixture(scope="module")
def comparison(signals: SmoothedSignals) -> Comparison:
    return choose_friction(load_robot("ir361"), [signals], candidates=CANDIDATES)


def test_each_joint_gets_the_terms_that_it_has(comparison: Comparison) -> None:
    assert comparison.chosen == TRUTH


def test_the_error_on_parts_left_out_is_the_noise(comparison: Comparison) -> None:
    np.testing.assert_allclose(comparison.combined.error_nm, 1.0, atol=0.05)
    assert comparison.trials[0].error_nm[1] > 1.2


def test_the_criteria_prefer_each_joint_s_own(comparison: Comparison) -> None:
    assert comparison.combined.bic == min(t.bic for t in (*comparison.trials, comparison.combined))


def test_the_robot_carries_the_choice(comparison: Comparison) -> None:
    robot = comparison.robot(load_robot("ir361"))
    assert tuple(joint.friction for joint in robot.joints) == TRUTH


def test_the_watcher_hears_of_every_model(signals: SmoothedSignals) -> None:
    heard: list[tuple[int, int]] = []
    choose_friction(
        load_robot("ir361"),
        cut(signals, 2),
        candidates=CANDIDATES[:2],
        folds=2,
        watch=lambda done, total, _: heard.append((done, total)),
    )
    assert heard[:2] == [(0, 3), (1, 3)]
    assert set(heard[2:]) <= {(2, 3)}


HARD: Joints = (
    (*CLASSICAL, "offset"),
    (*CLASSICAL, "offset", "load"),
    (*CLASSICAL, "offset", "stribeck"),
)


@pytest.mark.parametrize("terms", [(*CLASSICAL, "offset", "cubic"), *HARD])
def test_a_trial_is_what_fitting_every_part_from_the_rows_gives(terms: Terms) -> None:
    robot, parts = load_robot("ir361"), tuple(cut(recording(HARD, 2400, 0.2, (0.1, 0.08)), 3))
    trial = CondensedTrials.begin(robot, parts, [CLASSICAL, terms], EstimationOptions())
    fast, slow = (each.of([terms] * 3) for each in (trial, ExhaustiveTrials(robot, parts)))
    assert fast.parameters == slow.parameters
    # Which way a gear is loaded is known by the estimate itself there, by another here.
    known = 2e-2 if "load" in terms else 1e-4 if "stribeck" in terms else 1e-9
    np.testing.assert_allclose(fast.event_errors, slow.event_errors, rtol=known)


def test_joints_choose_nonlinear_terms_too() -> None:
    hard = recording(HARD, 6000, 0.2, (0.1, 0.08))
    found = choose_friction(load_robot("ir361"), [hard], candidates=[CLASSICAL, *HARD], folds=3)
    assert found.chosen == HARD


def test_both_ways_doubt_the_same_terms() -> None:
    # Load-dependent friction that is none: positive on joint 1, none on joint 2, below zero on 3.
    loaded: Joints = ((*CLASSICAL, "load"),) * 3
    parts = tuple(cut(recording(loaded, 2400, 0.2, (0.1, 0.0, -0.05)), 3))
    robot = load_robot("ir361")
    trials = CondensedTrials.begin(robot, parts, [CLASSICAL, loaded[0]], EstimationOptions())
    expected = ((), ("load",), ("load",))
    slow = ExhaustiveTrials(robot, parts)
    assert trials.doubtful(loaded) == slow.doubtful(loaded) == expected
    shifted: Joints = ((*CLASSICAL, "offset"),) * 3
    trials = CondensedTrials.begin(robot, parts, [CLASSICAL, shifted[0]], EstimationOptions())
    assert trials.offsets_told(shifted) == slow.offsets_told(shifted)


@dataclass
class Table:
    """Trials of two joints whose errors are known, and what is doubtful in them."""

    errors: dict[Joints, tuple[float, float]]
    doubted: dict[Joints, Joints] = field(default_factory=dict)
    told: tuple[bool, bool] = (False, False)

    def of(self, friction: Sequence[Terms], name: Terms = ()) -> Trial:
        mean = np.array(self.errors[tuple(friction)])
        events = mean * np.array([[0.98], [1.0], [1.02]])
        return Trial(name, np.sqrt(mean), events, len(friction), 0.0, 0.0)

    def doubtful(self, friction: Sequence[Terms]) -> tuple[Terms, ...]:
        return self.doubted.get(tuple(friction), ((), ()))

    def offsets_told(self, friction: Sequence[Terms]) -> tuple[bool, ...]:
        return tuple("offset" in t and told for t, told in zip(friction, self.told, strict=True))


LOAD: Terms = (*CLASSICAL, "load")
ALONE: dict[Joints, tuple[float, float]] = {
    (CLASSICAL, CLASSICAL): (1.0, 1.0),
    (CLASSICAL, LOAD): (1.0, 0.1),
    (LOAD, CLASSICAL): (0.1, 1.0),
    (LOAD, LOAD): (0.1, 0.1),
}
"""Errors of each joint with one's terms not bending the other's."""


def test_what_joints_choose_one_by_one_is_not_taken_if_a_row_of_the_table_is_better() -> None:
    errors = ALONE | {(LOAD, LOAD): (0.1, 0.999), (LOAD, CLASSICAL): (3.0, 3.0)}
    found = select(("a", "b"), [CLASSICAL, LOAD], Table(errors))
    assert found.chosen == (LOAD, LOAD)
    assert found.combined.terms == ()
    np.testing.assert_allclose(found.combined.error_nm**2, errors[LOAD, LOAD])


def test_a_term_that_is_not_told_from_zero_is_not_taken() -> None:
    table = Table(ALONE, {(LOAD, LOAD): ((), ("load",))})
    found = select(("a", "b"), [CLASSICAL, LOAD], table)
    assert found.chosen == (LOAD, CLASSICAL)
    np.testing.assert_allclose(found.combined.error_nm**2, ALONE[LOAD, CLASSICAL])


def test_in_place_of_a_refused_term_a_joint_takes_the_simplest_good_one_without_it() -> None:
    cubic, rich = (*CLASSICAL, "cubic"), (*CLASSICAL, "cubic", "cube_root")
    good = {CLASSICAL: 1.0, LOAD: 0.1, cubic: 0.1, rich: 0.1}
    errors: dict[Joints, tuple[float, float]] = {
        (a, b): (good[a], good[b]) for a in good for b in good
    }
    table = Table(errors, {(LOAD, LOAD): (("load",), ())})
    found = select(("a", "b"), [CLASSICAL, LOAD, cubic, rich], table)
    assert found.chosen == (cubic, LOAD)


def test_an_offset_that_is_told_from_zero_stays_though_it_gains_nothing_here() -> None:
    shifted = (*CLASSICAL, "offset")
    errors: dict[Joints, tuple[float, float]] = {
        (a, b): (1.0, 1.0) for a in (CLASSICAL, shifted) for b in (CLASSICAL, shifted)
    }
    found = select(("a", "b"), [CLASSICAL, shifted], Table(errors, told=(False, True)))
    assert found.chosen == (CLASSICAL, shifted)
    found = select(("a", "b"), [CLASSICAL], Table(errors, told=(True, True)))
    assert found.chosen == (CLASSICAL, CLASSICAL)


def test_nothing_to_leave_out_is_told(signals: SmoothedSignals) -> None:
    with pytest.raises(EstimationError, match="two parts"):
        choose_friction(load_robot("ir361"), [signals], folds=1)
    with pytest.raises(EstimationError, match="and candidates"):
        choose_friction(load_robot("ir361"), [signals], candidates=())


def test_parts_are_the_recording(signals: SmoothedSignals) -> None:
    parts = cut(signals, 7)
    np.testing.assert_array_equal(np.concatenate([p.time_s for p in parts]), signals.time_s)
    assert replace(parts[0]).cutoff_hz == signals.cutoff_hz
