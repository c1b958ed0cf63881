"""The incremental mean period equals the average of all periods so far."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.monitor import (
    MONITOR,
    MonitorHeader,
    MonitorWriter,
    read_run_temperatures,
    with_temperature_compensation,
)
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from acquisition.session.early_stop import NewPeriods
from config.load import load_robot
from config.robot.robot import RobotDescription
from drivers.interfaces.drive_monitor import MonitorReading
from rid_daq.recording.average_so_far import AverageSoFar

K, PERIODS, T = 50, 8, 0.01


@pytest.fixture
def robot() -> RobotDescription:
    """Return a robot whose torque constants decrease with temperature."""
    plain = load_robot("ir361")
    joints = tuple(
        joint.model_copy(update={"torque_constant_per_k": -0.002}) for joint in plain.joints
    )
    return plain.model_copy(update={"joints": joints})


@pytest.fixture
def recording(robot: RobotDescription) -> Recording:
    random = np.random.default_rng(3)
    rows = K * PERIODS
    turns = 2.0 * np.pi * np.arange(rows)[:, np.newaxis] / K + np.arange(3)
    return Recording(
        joint_names=robot.joint_names,
        time_s=T * np.arange(rows, dtype=np.float64),
        position=np.sin(turns) + 1e-3 * random.normal(size=(rows, 3)),
        torque_nm=9.0 * np.cos(turns) + random.normal(size=(rows, 3)),
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=T,
        samples_per_period=K,
    )


def monitored_until(path: Path, end_s: float) -> None:
    """Write the monitor's file up to a time: readings every 0.7 s; one drive answers late."""
    path.unlink(missing_ok=True)
    names = ("axis1", "axis2", "axis3")
    with MonitorWriter(path, MonitorHeader(joint_names=names, period_s=0.7)) as writer:
        for second in np.arange(0.1, end_s, 0.7):
            kelvin = 300.0 + second * np.array([1.0, 2.0, np.nan if second < 1.0 else 3.0])
            writer.append(float(second), MonitorReading(kelvin, np.zeros(3), ()))


@pytest.mark.parametrize("warm", [False, True])
def test_the_incremental_average_equals_the_average_of_all_periods(
    robot: RobotDescription, recording: Recording, tmp_path: Path, warm: bool
) -> None:
    average = AverageSoFar(robot)
    for periods in range(3, PERIODS + 1):
        begin = 0 if periods == 3 else (periods - 1) * K
        if warm:
            monitored_until(tmp_path / MONITOR, T * K * periods)
        new = NewPeriods(recording.part(slice(begin, periods * K)), tmp_path, begin, periods)
        found = average.with_new_periods(new)
        raw = recording.part(slice(0, periods * K))
        stream, _ = read_run_temperatures(raw, tmp_path)
        whole = average_periods(with_temperature_compensation(raw, stream, robot))
        assert (found.temperature_k is not None) is (warm and periods > 3)  # one drive was late
        for field in fields(whole):
            one, other = getattr(whole, field.name), getattr(found, field.name)
            if isinstance(one, np.ndarray):
                assert one.tobytes() == other.tobytes(), field.name
            else:
                assert one == other
