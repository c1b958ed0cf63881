"""A recording refuses what it cannot mean, and cannot be changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code


def fields(rows: int = 5) -> dict[str, Any]:
    return {
        "joint_names": ("a", "b"),
        "time_s": np.arange(rows) * 0.01,
        "position": np.zeros((rows, 2)),
        "torque_nm": np.zeros((rows, 2)),
        "valid": np.ones(rows, dtype=bool),
        "phase": np.zeros(rows, dtype=np.uint8),
        "sample_index": np.arange(rows),
        "source": "cell",
    }


def test_keeps_its_own_read_only_copies() -> None:
    given = fields()
    recording = Recording(**given)
    given["position"][0, 0] = 9.0
    assert recording.position[0, 0] == 0.0
    assert len(recording) == 5
    with pytest.raises(ValueError, match="read-only"):
        recording.torque_nm[0, 0] = 1.0


def test_names_the_row_where_time_does_not_increase() -> None:
    given = fields()
    given["time_s"][3] = given["time_s"][2]
    with raises_code(RecordingError, "RID-RECORDING-CLOCK", "0.020000"):
        Recording(**given)


@pytest.mark.parametrize("name", ["time_s", "position", "torque_nm"])
def test_refuses_what_is_not_finite(name: str) -> None:
    given = fields()
    given[name].flat[1] = np.inf
    with pytest.raises(RecordingError, match=f"{name} is not finite"):
        Recording(**given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"torque_nm": np.zeros((5, 3))}, r"torque_nm must have shape \(5, 2\), it has \(5, 3\)"),
        ({"valid": np.ones(4, dtype=bool)}, r"valid must have shape \(5\)"),
        ({"target_position": np.zeros((4, 2))}, "target_position must have shape"),
        ({"sample_period_s": 0.0}, "not positive"),
        ({"samples_per_period": 5}, "needs its sample_period_s"),
        ({"joint_names": ()}, "no joints"),
    ],
)
def test_refuses_what_does_not_fit_together(change: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        Recording(**(fields() | change))


def test_holds_the_drives_temperatures_where_they_are_known() -> None:
    assert Recording(**fields()).temperature_k is None
    warm = np.full((5, 2), 310.0)
    assert Recording(**(fields() | {"temperature_k": warm})).temperature_k is not None
    with pytest.raises(RecordingError, match=r"temperature_k must have shape \(5, 2\)"):
        Recording(**(fields() | {"temperature_k": warm[0]}))
