"""The meaning of torques, judged from data: gravity, friction and noise in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import load_import_map
from acquisition.maps.torque_meaning import TorqueMeaning
from acquisition.recording.recording import Recording
from benchmarks.sound_robots import SoundRecording, sound_run
from config.load import load_robot
from identification.wiring.torque_origin import (
    TorqueJudgement,
    judge_torques,
    torque_contradiction,
)

RECORDING = "ur-20_02_12-50sec_12harm.csv"
ROBOT = load_robot("ir361")


@pytest.fixture(scope="module")
def sound() -> SoundRecording:
    """Return a recording of a simulated arm with friction and noise."""
    return sound_run(ROBOT, np.random.default_rng(1))


def recording_of(sound: SoundRecording, torque_nm: np.ndarray) -> Recording:
    rows = len(sound.time_s)
    return Recording(
        joint_names=ROBOT.joint_names,
        time_s=sound.time_s,
        position=sound.position,
        torque_nm=torque_nm,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.zeros(rows, dtype=np.uint8),
        sample_index=np.full(rows, -1, dtype=np.int64),
        source="import",
        robot_name="ir361",
    )


def judge(sound: SoundRecording, torque_nm: np.ndarray) -> TorqueJudgement:
    judged = judge_torques(recording_of(sound, torque_nm), ROBOT, currents=False)
    assert judged is not None
    return judged


def test_torques_that_are_0_show_no_meaning(sound: SoundRecording) -> None:
    """Drivers without torques write 0, which a robot without gravity would explain."""
    empty = recording_of(sound, np.zeros_like(sound.torque_nm))
    assert judge_torques(empty, ROBOT, currents=False) is None


def test_torques_with_friction_and_gravity_are_those_of_motors(sound: SoundRecording) -> None:
    judged = judge(sound, sound.torque_nm)
    assert judged.meanings == ("motor_torque",)
    assert judged.contradicts_friction_of("joint_torque")
    assert not judged.contradicts_friction_of("motor_torque")
    assert replace(judged, currents=True).meanings == ("motor_current",)


def test_torques_without_gravity_are_compensated(sound: SoundRecording) -> None:
    judged = judge(sound, sound.torque_nm - sound.gravity_nm)
    assert judged.meanings == ("gravity_compensated",)


def test_noise_alone_shows_no_meaning(sound: SoundRecording) -> None:
    noise = np.random.default_rng(2).standard_normal(sound.torque_nm.shape)
    assert judge(sound, noise).meanings == ()


@pytest.mark.parametrize(
    ("stated", "is_contradicted", "without_friction"),
    [
        (None, False, True),
        ("motor_current", False, True),
        ("motor_torque", False, True),
        ("joint_torque", True, False),
        ("model_based", False, False),
        ("gravity_compensated", True, True),
    ],
)
def test_a_stated_or_assumed_meaning_is_tested(
    sound: SoundRecording,
    stated: TorqueMeaning | None,
    is_contradicted: bool,
    without_friction: bool,
) -> None:
    """A map that states no meaning is tested as one that states motor torques."""
    noise = np.random.default_rng(3).standard_normal(sound.gravity_nm.shape)
    size = np.std(sound.torque_nm, axis=0)
    inertia_nm = 0.3 * size * sound.acceleration / np.std(sound.acceleration, axis=0)
    of_sensors = sound.gravity_nm + inertia_nm + 0.01 * size * noise
    for torque_nm, expected in (
        (sound.torque_nm, is_contradicted),
        (of_sensors, without_friction),
    ):
        found = torque_contradiction(stated, recording_of(sound, torque_nm), ROBOT, ())
        assert bool(found) == expected
        assert not found or (stated or "`torques`") in found


@pytest.mark.parametrize(
    ("first", "meanings"),
    [(None, ("motor_current",)), (25, ("joint_torque", "model_based"))],
    ids=["measured currents", "the controller's target moments"],
)
def test_a_real_robot(
    first: int | None, meanings: tuple[TorqueMeaning, ...], real_robot: Path
) -> None:
    import_map, robot = load_import_map("ur10e_31")
    rows = import_map.rows.model_copy(update={"first": 355, "last": 5090})
    changes: dict[str, object] = {"rows": rows}
    if first is not None:
        changes["joints"] = tuple(
            joint.model_copy(
                update={"current": None, "torque": first + j, "torque_constant_nm_per_a": None}
            )
            for j, joint in enumerate(import_map.joints)
        )
    recording, _ = import_csv(real_robot / RECORDING, import_map.model_copy(update=changes), robot)
    judged = judge_torques(recording, robot, currents=first is None)
    assert judged is not None
    assert judged.meanings == meanings
