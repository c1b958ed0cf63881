"""An imported recording gives the same velocity loops as the run itself with its motion file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.maps.command_timing import CommandTiming
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from compensation.loops.imported_spectra import excited_lines, imported_spectra
from compensation.loops.loop_measurement import measure_loops, measure_spectra
from compensation.loops.multisine_spectra import cell_timing
from config.errors import DataQualityError
from config.load import LoadedCell
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Drive = Callable[..., Recording]
PERIOD_S = 4.0


@pytest.fixture(scope="module")
def motion() -> MultisineMotion:
    joints = tuple(
        {"joint": name, "velocity": 0.03, "slow_amplitude": 0.1}
        for name in ("axis1", "axis2", "axis3")
    )
    return MultisineMotion.model_validate(
        {
            "kind": "multisine",
            "robot": "ir361",
            "period_s": PERIOD_S,
            "lowest_hz": 2.0,
            "highest_hz": 20.0,
            "realisations": 1,
            "periods": 3,
            "ramp_s": 1.0,
            "joints": joints,
        }
    )


@pytest.fixture(scope="module")
def recorded(cell: LoadedCell, drive: Drive, motion: MultisineMotion) -> Recording:
    return drive(motion.plan(cell.robot, cell.config.cycle_time_s))


@pytest.fixture(scope="module")
def imported(recorded: Recording) -> Recording:
    """Return the whole periods of a run in the form of an imported recording."""
    whole = recorded.part(recorded.phase == Phase.MAIN)
    assert whole.sample_period_s is not None
    return replace(
        whole,
        source="import",
        target_position=None,
        answered=None,
        sample_index=np.arange(len(whole)),
        samples_per_period=round(PERIOD_S / whole.sample_period_s),
    )


def test_an_import_without_motion_file_gives_the_same_loops(
    cell: LoadedCell, motion: MultisineMotion, recorded: Recording, imported: Recording
) -> None:
    gain = cell.config.position_gain_per_s
    expected = measure_loops(recorded, motion, cell.robot, gain).loops
    timing = cell_timing(cell.config.cycle_time_s)
    found = measure_spectra(imported_spectra(imported, cell.robot, timing), gain).loops
    assert [loop.joint_name for loop in found] == list(cell.robot.joint_names)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.gain == pytest.approx(theirs.gain, rel=1e-8)
        assert ours.integral_time_s == pytest.approx(theirs.integral_time_s, rel=1e-8)
        assert ours.sigma["gain"] == pytest.approx(theirs.sigma["gain"], rel=1e-6)


def test_the_excited_lines_are_those_of_the_design(
    cell: LoadedCell, motion: MultisineMotion, imported: Recording
) -> None:
    timing = cell_timing(cell.config.cycle_time_s)
    found = imported_spectra(imported, cell.robot, timing).lines
    for ours, theirs in zip(found, motion.excited_lines(cell.robot), strict=True):
        assert ours.tolist() == theirs.tolist()


def test_lines_of_two_joints_belong_to_none() -> None:
    commands = np.full((3, 40, 2), 1e-6, dtype=complex)
    commands[:, 10:20, 0] = 1.0
    commands[:, 15:30, 1] = 1.0
    first, second = excited_lines(commands)
    assert first.tolist() == list(range(10, 15))
    assert second.tolist() == list(range(20, 30))


def test_a_joint_with_few_lines_of_its_own_is_not_excited() -> None:
    commands = np.full((3, 40, 1), 1e-6, dtype=complex)
    commands[:, 1, 0] = 5.0  # a slow sine
    commands[:, 10:13, 0] = 1.0
    assert excited_lines(commands)[0].tolist() == []


def test_an_import_without_commands_periods_or_rows_is_refused(
    cell: LoadedCell, imported: Recording
) -> None:
    def read(**changes: Any) -> None:
        imported_spectra(replace(imported, **changes), cell.robot, CommandTiming())

    with raises_code(DataQualityError, "RID-RUN-FOREIGN", "velocity_command"):
        read(velocity_command=None)
    with raises_code(DataQualityError, "RID-RECORDING-PERIODS"):
        read(samples_per_period=None)
    with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST"):
        read(valid=np.arange(len(imported)) != 5)
    assert imported.velocity_command is not None
    with raises_code(DataQualityError, "RID-LOOP-WEAK"):
        read(velocity_command=np.zeros_like(imported.velocity_command))
