"""Feedforward files: every row has one number per joint."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.motion.kinds.joint_table import JointTableMotion
from compensation.feedforward.file import FORMAT, feedforward_content
from config.errors import ConfigError
from tests.builders.raised_codes import raises_code

MOTION = JointTableMotion(
    kind="joint_table",
    robot="ir361",
    joints=("axis1", "axis2"),
    time_s=(0.0, 1.0),
    position=((0.0, 0.0), (0.1, 0.1)),
)
ROWS = [[0.0, 0.0], [0.1, 0.1]]


def content(**changes: object) -> bytes:
    """Return a feedforward file of two rows and two joints."""
    file = {
        "format": FORMAT,
        "cycle_time_ms": 8,
        "joints": ["axis1", "axis2"],
        "motion": MOTION.model_dump(mode="json"),
        "feedforward": ROWS,
    }
    return json.dumps(file | changes).encode()


@pytest.mark.parametrize("key", ["feedforward", "deflection"])
@pytest.mark.parametrize("rows", [[[0.0, 0.0], [0.1]], [[0.0] * 3, [0.1] * 3]])
def test_rows_of_another_length_are_refused(key: str, rows: list[list[float]]) -> None:
    assert feedforward_content(content(), Path("ff.json")).joints == ("axis1", "axis2")
    with raises_code(ConfigError, "RID-FILE-VALUE", "ff.json", key):
        feedforward_content(content(**{key: rows}), Path("ff.json"))
