"""Every kind of motion: read and written without change, planned within limits, described."""

from __future__ import annotations

import copy
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.kinds.motion import Motion
from acquisition.motion.motion_file import AnyMotion, load_motion
from config.errors import ConfigError
from config.formats.yaml_tree import dump_yaml, parse_yaml
from config.load import load_robot, to_yaml, validate
from rid_daq.command_line.root import COMMANDS
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
T = 0.008
KINDS: dict[str, type[Motion]] = {
    typing.get_args(kind.model_fields["kind"].annotation)[0]: kind
    for kind in typing.get_args(typing.get_args(AnyMotion)[0])
}
JOINTS = ("axis1", "axis2", "axis3")
SERIES = [
    {"joint": name, "offset": 0.1, "sine": [0.2, 0.01], "cosine": [0.1, 0.0]} for name in JOINTS
]
NEAR = [0.1, -0.1, 0.4]
TIMES = np.linspace(0.0, 1.0, 41)
SHARES = TIMES**3 * (10.0 - 15.0 * TIMES + 6.0 * TIMES**2)
SHARE_RATES = 30.0 * TIMES**2 * (1.0 - TIMES) ** 2
SHARE_CHANGES = 60.0 * TIMES * (1.0 - TIMES) * (1.0 - 2.0 * TIMES)

EXAMPLES: dict[str, dict[str, Any]] = {
    "fourier": {"period_s": 2.0, "periods": 2, "ramp_s": 1.0, "joints": SERIES},
    "reversed": {"period_s": 2.0, "periods": 2, "ramp_s": 1.0, "joints": SERIES},
    "multipoint": {"seed": 5, "points": 3},
    "pose_sequence": {"points": [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3]], "dwell_s": 0.5},
    "constant_velocity": {
        "pose": [0.1, -0.2, 0.3],
        "joints": [{"joint": "axis2", "low": -0.5, "high": 0.5, "speeds": [0.5]}],
    },
    "multisine": {
        "period_s": 2.0,
        "lowest_hz": 1.0,
        "highest_hz": 20.0,
        "realisations": 2,
        "periods": 2,
        "joints": [{"joint": j, "velocity": 0.03, "slow_amplitude": 0.2} for j in JOINTS],
    },
    "circle": {
        "centre_m": [0.575, -0.078, -1.724],
        "radius_m": 0.2,
        "speed_m_s": 0.6,
        "near": NEAR,
        "periods": 1,
    },
    "path": {
        "start_m": [0.6, -0.2, -1.7],
        "near": NEAR,
        "speed_m_s": 0.4,
        "segments": [{"kind": "line", "to_m": [0.6, 0.1, -1.7]}],
    },
    "joint_path": {"points": [[0.0, 0.0, 0.0], [0.5, 0.3, -0.4], [0.0, 0.2, 0.3]]},
    "joint_table": {
        "joints": list(JOINTS),
        "time_s": (2.0 * TIMES).tolist(),
        "position": np.outer(SHARES, [0.5, 0.3, -0.4]).tolist(),
    },
    "timed_path": {
        "cycle_time_s": T,
        "ways": [
            {
                "points": [[0.0, 0.0, 0.0], [0.06, 0.04, -0.02], [0.1, 0.06, -0.08]],
                "length": [0.0, 0.6, 1.0],
                "place": SHARES.tolist(),
                "speed": (SHARE_RATES / (40 * T)).tolist(),
                "acceleration": (SHARE_CHANGES / (40 * T) ** 2).tolist(),
            }
        ],
    },
}


def content_of(kind: str) -> dict[str, Any]:
    return {"kind": kind, "robot": "ir361", **copy.deepcopy(EXAMPLES[kind])}


def read(keys: dict[str, Any]) -> Motion:
    return validate(parse_yaml(dump_yaml(keys).encode(), "motion.yaml"), KINDS[keys["kind"]])


def numbers(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the container and the key of every number in a file."""
    for key, value in list(tree.items()) if isinstance(tree, dict) else list(enumerate(tree)):
        if isinstance(value, dict | list):
            yield from numbers(value)
        elif isinstance(value, int | float):
            yield tree, key


def test_every_kind_of_the_schema_has_an_example() -> None:
    assert set(KINDS) == set(EXAMPLES)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_a_description_a_next_command_and_a_plan(kind: str, tmp_path: Path) -> None:
    (tmp_path / "motion.yaml").write_text(dump_yaml(content_of(kind)))
    motion = load_motion(tmp_path / "motion.yaml")
    assert type(motion) is KINDS[kind]
    sentence = motion.describe()
    assert sentence.endswith(".")
    assert len(sentence) > 20
    command, *words = motion.next_command(tmp_path)
    assert command in COMMANDS
    assert words[-1] == tmp_path
    samples = motion.plan(ROBOT, T)
    assert samples.joint_names == ROBOT.joint_names
    assert not samples.velocity[[0, -1]].any()
    motion.where(ROBOT, T, len(samples) // 2)
    (tmp_path / "kept.yaml").write_bytes(motion.to_keep((tmp_path / "motion.yaml").read_bytes()))
    assert load_motion(tmp_path / "kept.yaml") == motion


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12)
@given(data=st.data())
def test_a_changed_motion_is_refused_or_stays_equal_and_within_the_limits(
    kind: str, data: st.DataObject
) -> None:
    keys = content_of(kind)
    holder, key = data.draw(st.sampled_from(list(numbers(keys))))
    factor = data.draw(st.sampled_from([-1.0, 0.0, 0.1, 0.9, 1.1, 3.0, 1e3]))
    holder[key] = type(holder[key])(holder[key] * factor)
    try:
        motion = read(keys)
        samples = motion.plan(ROBOT, T)
    except ConfigError as error:
        assert str(error)  # noqa: PT017
        return
    assert validate(parse_yaml(to_yaml(motion).encode(), "again.yaml"), KINDS[kind]) == motion
    for j, joint in enumerate(ROBOT.joints):
        limits = joint.limits
        assert samples.position[:, j].min() >= limits.position_min - 1e-9
        assert samples.position[:, j].max() <= limits.position_max + 1e-9
        assert np.abs(samples.velocity[:, j]).max() <= limits.velocity * (1.0 + 1e-9)
        assert np.abs(samples.acceleration[:, j]).max() <= limits.acceleration * (1.0 + 1e-9)
    assert np.abs(samples.velocity[[0, -1]]).max() < 1e-9


def test_more_than_the_allowed_harmonics_are_refused() -> None:
    motion = read(content_of("multisine") | {"period_s": 100.0, "transient_periods": 0})
    with raises_code(ConfigError, "RID-MOTION-BAND", "2000", "period_s", "1000"):
        motion.plan(ROBOT, T)


def test_a_motion_of_another_kind_is_refused() -> None:
    motion = read(content_of("multipoint"))
    with raises_code(ConfigError, "RID-MOTION-KIND"):
        FourierMotion.require(motion, "a session needs a fourier motion")


def test_a_written_motion_is_read_back_equal(tmp_path: Path) -> None:
    motion = FourierMotion(
        kind="fourier",
        robot="ir361",
        period_s=10.0,
        joints=(FourierJoint(joint="A1", sine=(0.1, 1e-7), cosine=(0.0, -0.25)),),
    )
    path = tmp_path / "motion.yaml"
    path.write_text(to_yaml(motion, "An excitation."))
    assert load_motion(path) == motion


def test_an_unknown_kind_is_refused_with_the_known_kinds(tmp_path: Path) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text("robot: ir361\nkind: forier\n")
    names = ("motion.yaml:2:1: kind:", "'forier'", "fourier?", ", multipoint,")
    with raises_code(ConfigError, "RID-FILE-VALUE", *names):
        load_motion(path)
    path.write_text("robot: ir361\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", "yaml:1:1", "'kind'", "fourier"):
        load_motion(path)


def test_an_unknown_key_is_refused_with_the_nearest_key(tmp_path: Path) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text("kind: multipoint\nrobot: ir361\nseed: 1\nsped_fraction: 0.5\n")
    with raises_code(ConfigError, "RID-FILE-VALUE", "speed_fraction"):
        load_motion(path)
