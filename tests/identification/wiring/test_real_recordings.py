"""In correct recordings of real robots no mistake is found; an injected mistake is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.processing.smoothing import smooth_nonperiodic
from config.load import load_bundled_or_path, load_robot
from identification.regression.fit_grade import BAD_SHARE, GOOD_SHARE
from identification.wiring.held_out import held_out_share
from identification.wiring.mistakes import MistakeKind
from identification.wiring.search import find_impossibilities, find_mistakes
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations

LONG = ("ur-20_02_12-50sec_12harm", 355, 5090)
SOUND = [
    LONG,
    ("ur-20_02_10-30sec_12harm", 635, 3510),
    ("ur-20_01_17-ptp_10_points", 700, 4200),
    ("ur-20_01_31-unload", 300, 2623),
    ("ur-20_01_31-load", 370, 2881),
    ("ur-20_01_22-joint_2", 1, None),
    ("ur-20_01_22-joint_4", 1, None),
]


def of_ur10e(folder: Path, name: str, first: int, last: int | None) -> WiredSignals:
    layout = load_bundled_or_path("ur10e_31", "maps", ImportMap)
    rows = layout.model_copy(update={"rows": RowRange(first=first, last=last)})
    recording, _ = import_csv(folder / f"{name}.csv", rows)
    return WiredSignals.of(load_robot("ur10e"), [smooth_nonperiodic(recording, 10.0)])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "first", "last"), SOUND)
def test_nothing_is_found_in_recordings_of_a_ur10e(
    real_robot: Path, name: str, first: int, last: int | None
) -> None:
    assert find_mistakes(of_ur10e(real_robot, name, first, last)) == ()


def test_swapped_columns_are_found(real_robot: Path) -> None:
    sound = of_ur10e(real_robot, *LONG)
    order = [0, 2, 1, 3, 4, 5]
    (found,) = find_mistakes(replace(sound, torque_nm=sound.torque_nm[:, order]))
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.TORQUE_ORDER, (1, 2))


@pytest.mark.parametrize(("name", "first", "last"), SOUND[:5])
def test_the_file_of_a_ur10e_predicts_held_out_parts(
    real_robot: Path, name: str, first: int, last: int | None
) -> None:
    assert held_out_share(of_ur10e(real_robot, name, first, last)).max() < 0.5 * BAD_SHARE


@pytest.mark.parametrize(("name", "first", "last"), SOUND[:2])
def test_the_file_of_a_kuka_fails_on_held_out_parts_of_a_ur10e(
    real_robot: Path, name: str, first: int, last: int | None
) -> None:
    signals = replace(of_ur10e(real_robot, name, first, last), robot=load_robot("kr15"))
    share = CondensedEquations.of(signals).trial(np.eye(6)).residual_share
    assert GOOD_SHARE < share[3] < BAD_SHARE < held_out_share(signals)[3]


def test_no_torque_factor_is_proposed_if_the_estimated_weight_is_noise(
    real_robot: Path,
) -> None:
    """With the file of another robot the estimated weight is zero within its noise, so 1 / weight
    is not a usable factor.
    """
    signals = of_ur10e(real_robot, "ur-20_02_10-30sec_12harm", 635, 1500)
    other = {"kinematics": load_robot("kr15").kinematics, "cad": None}
    robot = signals.robot.model_copy(update=other)
    signals = replace(signals, robot=robot)
    _, weight = find_impossibilities(signals)
    assert weight is not None
    assert not weight.is_plausible
    assert abs(weight.share) < 2.0 * weight.sigma
    assert [each.mistake.kind for each in find_mistakes(signals)] == [MistakeKind.KINEMATICS]


@pytest.mark.parametrize("still", [(0,), (4, 5)])
def test_the_torque_of_a_joint_at_rest_is_not_exchanged_with_another(
    real_robot: Path, still: tuple[int, ...]
) -> None:
    signals = of_ur10e(real_robot, *SOUND[1])
    q, v, a, torque_nm, moving = (
        getattr(signals, name).copy()
        for name in ("position", "velocity", "acceleration", "torque_nm", "moving")
    )
    for j in still:
        q[:, j], v[:, j], a[:, j], torque_nm[:, j], moving[j] = 0.5, 0.0, 0.0, 1.0, False
    at_rest = WiredSignals(signals.robot, q, v, a, torque_nm, moving)
    found = [each.mistake for each in find_mistakes(at_rest, fine=False)]
    assert [each.joints for each in found if each.kind is MistakeKind.TORQUE_ORDER] == []
