"""Entries of the files that a recording does not confirm, although no mistake is found in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sound_robots import sound_run
from config.load import load_robot
from identification.wiring.file_entries import EntryKind
from identification.wiring.fine_search import find_fine_mistake
from identification.wiring.flexible_fit import FlexibleFit
from identification.wiring.mistakes import MistakeKind, torque_factor
from identification.wiring.signals import WiredSignals
from identification.wiring.unconfirmed import fits_as_well, probes, unconfirmed_entries
from tests.identification.wiring.test_fine_search import with_lengths
from tests.identification.wiring.test_real_recordings import of_ur10e
from tests.identification.wiring.test_search import wired


@pytest.fixture(scope="module")
def unloaded(real_robot: Path) -> WiredSignals:
    """Twenty-five seconds of a real UR10e with a bare flange."""
    return of_ur10e(real_robot, "ur-20_01_31-unload", 300, 2623)


def entries(signals: WiredSignals) -> dict[EntryKind, tuple[int, ...]]:
    found = unconfirmed_entries(signals)
    assert found is not None
    return {each.kind: each.numbers for each in found}


@pytest.mark.parametrize("factor", [0.6, pytest.param(1.5, marks=pytest.mark.slow)])
def test_lengths_that_a_recording_does_not_show_are_reported(
    unloaded: WiredSignals, factor: float
) -> None:
    signals = replace(unloaded, robot=with_lengths(unloaded.robot, factor))
    assert find_fine_mistake(signals) is None
    assert EntryKind.LENGTHS in entries(signals)


def test_a_bare_flange_does_not_show_direction_and_scale_of_the_last_joint(
    unloaded: WiredSignals,
) -> None:
    found = entries(unloaded)
    for kind in (EntryKind.DIRECTION, EntryKind.POSITION_SCALE, EntryKind.TORQUE_SCALE):
        assert 5 in found[kind]
        assert 1 not in found[kind]


def test_a_common_factor_of_the_torques_is_confirmed_only_by_drawings(
    unloaded: WiredSignals,
) -> None:
    bare = replace(unloaded, robot=unloaded.robot.model_copy(update={"cad": None}))
    assert EntryKind.COMMON_TORQUE_SCALE in entries(bare)
    assert EntryKind.COMMON_TORQUE_SCALE not in entries(unloaded)


def test_a_mistake_that_the_data_show_does_not_fit_as_well() -> None:
    arm = wired(sound_run(load_robot("ur10e"), np.random.default_rng(4)))
    stated = FlexibleFit.of(arm)
    assert stated is not None
    backwards = next(
        mistake
        for kind, mistake in probes(arm)
        if kind is EntryKind.DIRECTION and mistake.joints == (1,)
    )
    assert not fits_as_well(backwards, arm, stated)


def test_too_few_rows_give_no_result(unloaded: WiredSignals) -> None:
    names = ("position", "velocity", "acceleration", "torque_nm")
    few = replace(unloaded, **{name: getattr(unloaded, name)[:15] for name in names})
    assert unconfirmed_entries(few) is None


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "factor"), [(1, 1.5), (2, 0.75), (3, 1.4)])
def test_any_factor_of_one_torque_is_found(
    unloaded: WiredSignals, joint: int, factor: float
) -> None:
    n = len(unloaded.robot.joints)
    found = find_fine_mistake(torque_factor(n, joint, factor).correct(unloaded))
    assert found is not None
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.TORQUE_FACTOR, (joint,))
    assert found.mistake.factor == pytest.approx(1.0 / factor, rel=0.15)
