"""A recording from arrays: an error names the array, and rows that were left out are noted."""

from __future__ import annotations

import re

import numpy as np
import pytest

from config.errors import ConfigError, DataQualityError
from rid_daq.api import Recording, plot
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm


def test_rows_that_are_left_out_are_noted(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 10.0)
    torque_nm = arm.torque_nm(q, v, a)
    torque_nm[5:9, 2] = np.nan
    recording = Recording.from_arrays(time_s, q, torque_nm, robot=arm.robot)
    assert len(recording) == len(time_s) - 4
    report = recording.run.import_report
    assert report is not None
    assert report.rows_damaged == 4
    assert len(report.notes) == 2
    assert recording.notes[:2] == report.notes
    assert str(recording).splitlines()[1:3] == list(report.notes)


def test_masked_values_are_left_out(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 10.0)
    masked = np.ma.array(arm.torque_nm(q, v, a))
    masked[5:9, 2] = np.ma.masked
    recording = Recording.from_arrays(time_s, q, masked, robot=arm.robot)
    assert len(recording) == len(time_s) - 4


def test_a_period_after_which_the_motion_does_not_repeat_is_refused(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 20.0)
    torque_nm = arm.torque_nm(q, v, a)
    with raises_code(DataQualityError, "RID-IMPORT-PERIOD"):
        Recording.from_arrays(time_s, q, torque_nm, robot=arm.robot, period_s=7.3)


def test_an_error_names_the_array_and_not_a_file(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 10.0)
    with raises_code(DataQualityError, "RID-IMPORT-UNITS", "velocity[:, 0]", "mine") as raised:
        Recording.from_arrays(
            1e3 * time_s, q, arm.torque_nm(q, v, a), velocity=v, robot=arm.robot, name="mine"
        )
    assert ".csv" not in str(raised.value)
    assert "column" not in str(raised.value)


def test_no_text_speaks_of_a_map(arm: Arm) -> None:
    time_s, q, v, a = arm.motion(5, 10.0)
    torque_nm = arm.torque_nm(q, v, a)
    notes = Recording.from_arrays(1e3 * time_s, q, torque_nm, robot=arm.robot).notes
    assert len(notes) == 2
    absent = np.where(q > q[0], np.nan, q)
    texts = list(notes)
    for stamps, rows in ((time_s[::-1], q), (time_s, absent), (time_s[:50], q[:50])):
        with raises_code(DataQualityError, "RID-IMPORT-ROWS") as raised:
            Recording.from_arrays(stamps, rows, torque_nm[: len(rows)], robot=arm.robot)
        texts.append(str(raised.value))
    assert not [text for text in texts if re.search(r"\bmap\b|`unit", text)]


def test_a_result_without_a_plot_is_refused_with_those_that_have_one(arm: Arm) -> None:
    with raises_code(ConfigError, "RID-API-ARGUMENT", "Recording", "Model"):
        plot(arm.robot)  # type: ignore[arg-type]


@pytest.mark.parametrize("missing", [0, 1000])
def test_missing_values_are_counted(arm: Arm, missing: int) -> None:
    time_s, q, v, a = arm.motion(5, 10.0)
    torque_nm = arm.torque_nm(q, v, a)
    torque_nm[:missing, 2] = np.nan
    if not missing:
        stated = Recording.from_arrays(
            time_s, q, torque_nm, robot=arm.robot, torques="motor_torque"
        )
        assert stated.notes == ()
        (note,) = Recording.from_arrays(time_s, q, torque_nm, robot=arm.robot).notes
        assert "`torques`" in note
        return
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "1000"):
        Recording.from_arrays(time_s, q, torque_nm, robot=arm.robot)
