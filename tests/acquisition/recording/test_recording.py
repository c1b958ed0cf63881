"""Recording: inconsistent values are refused, and arrays are immutable."""

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


def test_a_recording_keeps_its_own_read_only_copies() -> None:
    given = fields()
    recording = Recording(**given)
    given["position"][0, 0] = 9.0
    assert recording.position[0, 0] == 0.0
    assert len(recording) == 5
    assert not recording.torque_nm.flags.writeable


def test_the_row_at_which_time_does_not_increase_is_named() -> None:
    given = fields()
    given["time_s"][3] = given["time_s"][2]
    with raises_code(RecordingError, "RID-RECORDING-CLOCK", "0.020000"):
        Recording(**given)


@pytest.mark.parametrize("name", ["time_s", "position", "torque_nm"])
def test_a_recording_of_values_that_are_not_finite_is_refused(name: str) -> None:
    given = fields()
    given[name].flat[1] = np.inf
    with raises_code(RecordingError, "RID-API-ARGUMENT", f"{name} ", "1"):
        Recording(**given)


@pytest.mark.parametrize(
    ("change", "details"),
    [
        ({"torque_nm": np.zeros((5, 3))}, ("torque_nm", "(5, 2)", "(5, 3)")),
        ({"valid": np.ones(4, dtype=bool)}, ("valid", "(5)", "(4,)")),
        ({"target_position": np.zeros((4, 2))}, ("target_position", "(5, 2)", "(4, 2)")),
        ({"sample_period_s": 0.0}, ("sample_period_s 0.0",)),
        ({"samples_per_period": 5}, ("periodic", "sample_period_s")),
        ({"joint_names": ()}, ("no joints",)),
    ],
)
def test_a_recording_of_inconsistent_shapes_is_refused(
    change: dict[str, Any], details: tuple[str, ...]
) -> None:
    with raises_code(RecordingError, "RID-API-ARGUMENT", *details):
        Recording(**(fields() | change))


def test_a_recording_stores_the_drives_temperatures_if_they_are_known() -> None:
    assert Recording(**fields()).temperature_k is None
    warm = np.full((5, 2), 310.0)
    assert Recording(**(fields() | {"temperature_k": warm})).temperature_k is not None
    with raises_code(RecordingError, "RID-API-ARGUMENT", "temperature_k", "(5, 2)", "(2,)"):
        Recording(**(fields() | {"temperature_k": warm[0]}))
