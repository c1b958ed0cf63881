"""What a recorded torque went through is found where it is there, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identification.validation.friction_selection import CLASSICAL, choose_friction
from scipy.interpolate import CubicSpline

from acquisition.processing.smoothing import SmoothedSignals, low_pass, smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import LoadedCell
from identification.equations.deconvolution import without_torque_filter
from identification.estimation.estimate import predict
from identification.estimation.estimators import estimate_smoothed
from identification.estimation.file import read_estimate, write_estimate
from identification.export.function import python_function
from identification.export.model import ExportModel
from identification.validation.channel_choice import choose_bandwidth, choose_delays
from identification.validation.robot_terms import with_presliding as with_distances
from tests.builders import late_torque
from tests.builders.late_torque import FOUND_M, MOTION, robot_of
from tests.builders.remembering_arm import (
    CUTOFF_HZ,
    STEP_S,
    arm,
    measured,
    motion,
    recording,
    with_presliding,
)
from tests.identification.conftest import CYCLE_S

BANDWIDTH_HZ = 2.5
LATE_S = np.array([0.0, 0.006, -0.004])
WAY = motion(30.0, 1)


def late(signals: SmoothedSignals, delay_s: FloatArray) -> SmoothedSignals:
    torque = [
        CubicSpline(signals.time_s, column)(np.maximum(signals.time_s - by, 0.0))
        for column, by in zip(signals.torque_nm.T, delay_s, strict=True)
    ]
    return replace(signals, torque_nm=np.transpose(torque))


@pytest.fixture(scope="module")
def narrow() -> SmoothedSignals:
    """A torque that was low-passed long before it was recorded."""
    whole = measured({}, WAY)
    torque = low_pass(whole.torque_nm, STEP_S, BANDWIDTH_HZ)
    return smooth_nonperiodic(replace(whole, torque_nm=torque), CUTOFF_HZ)


def test_a_bandwidth_below_the_cut_off_is_found(narrow: SmoothedSignals) -> None:
    found = choose_bandwidth(arm(), [narrow])
    assert found == pytest.approx(BANDWIDTH_HZ, rel=0.08)


def test_a_torque_that_holds_the_whole_band_has_none() -> None:
    assert choose_bandwidth(arm(), [recording({}, WAY)]) is None


def test_a_known_bandwidth_takes_the_bend_out_of_the_estimate(narrow: SmoothedSignals) -> None:
    known = replace(narrow, torque_bandwidth_hz=BANDWIDTH_HZ)
    plain, right = estimate_smoothed(arm(), [narrow]), estimate_smoothed(arm(), [known])
    assert np.all(right.residual_nm < 0.5 * plain.residual_nm)
    coulomb = [right.base.names.index(f"fc_axis{j}") for j in (1, 2, 3)]
    np.testing.assert_allclose(right.values[coulomb], 20.0, atol=0.5)


def test_friction_is_chosen_with_the_bandwidth(narrow: SmoothedSignals) -> None:
    candidates = [CLASSICAL, (*CLASSICAL, "offset", "cube_root")]
    known = replace(narrow, torque_bandwidth_hz=BANDWIDTH_HZ)
    errors = [
        choose_friction(arm(), [each], candidates=candidates).trials[0].error_nm
        for each in (narrow, known)
    ]
    assert np.all(errors[1] < 0.6 * errors[0])


def test_delays_of_parts_of_a_sample_are_found_where_they_are() -> None:
    signals = late(recording({}, WAY), LATE_S)
    channel = choose_delays(arm(), [signals])
    assert channel.delay_s[0] == 0.0
    assert channel.delay_sigma_s[0] == 0.0
    np.testing.assert_array_less(
        np.abs(channel.delay_s - LATE_S)[1:], 3.0 * channel.delay_sigma_s[1:]
    )
    assert np.all(channel.delay_sigma_s[1:] < 0.001)
    back = channel.undelayed(signals).torque_nm[50:-50, 1]
    np.testing.assert_allclose(back, recording({}, WAY).torque_nm[50:-50, 1], atol=2.0)


def test_a_recording_in_time_has_no_delay() -> None:
    channel = choose_delays(arm(), [recording({}, WAY)])
    assert not channel.changes
    assert channel.bandwidth_hz is None


def in_time(recording: Recording) -> SmoothedSignals:
    return smooth_nonperiodic(without_torque_filter(recording), 10.0)


@pytest.fixture(scope="module")
def giving_way(cell: LoadedCell) -> Recording:
    """Drive joints that give way at reversals, hold more at low speed, cog and warm up."""
    assert cell.plant is not None
    return closed_loop(cell, cell.plant, MOTION.plan(cell.robot, CYCLE_S), 1)


@pytest.mark.parametrize("distances", [(None,) * 3, FOUND_M])
def test_hysteresis_is_no_delay(
    cell: LoadedCell, giving_way: Recording, distances: tuple[float | None, ...]
) -> None:
    robot = with_distances(robot_of(cell), distances)
    assert not choose_delays(robot, [in_time(giving_way)]).changes


def test_delays_come_back_from_joints_with_another_law(
    cell: LoadedCell, giving_way: Recording
) -> None:
    true_s = np.array([0.002, -0.003, 0.004])
    delayed = late_torque.late(giving_way, list(1e3 * true_s))
    channel = choose_delays(with_distances(robot_of(cell), FOUND_M), [in_time(delayed)])
    assert np.all(channel.delay_s != 0.0)
    np.testing.assert_array_less(np.abs(channel.delay_s - true_s), 4.0 * channel.delay_sigma_s)
    assert np.all(channel.delay_sigma_s < 0.0003)


def test_joints_that_stick_are_not_early(cell: LoadedCell) -> None:
    assert cell.plant is not None
    plant = cell.plant.without_unmodelled()
    driven = closed_loop(cell, plant, MOTION.plan(cell.robot, CYCLE_S), 1)
    for distances in ((None,) * 3, FOUND_M):
        robot = with_distances(robot_of(cell), distances)
        assert not choose_delays(robot, [in_time(driven)]).changes


def test_a_joint_that_only_swings_shows_no_delay() -> None:
    """No row of it is a period of the cut-off away from a reversal."""
    signals = late(recording({}, WAY), LATE_S)
    channel = choose_delays(arm(), [replace(signals, torque_bandwidth_hz=0.2)])
    assert not channel.delay_s.any()


def test_an_estimate_keeps_its_channel_and_its_memory(
    narrow: SmoothedSignals, tmp_path: Path
) -> None:
    signals = replace(narrow, torque_bandwidth_hz=BANDWIDTH_HZ)
    estimate = estimate_smoothed(with_presliding((1,), 0.01), [signals])
    estimate = replace(estimate, channel=TorqueChannel(LATE_S, LATE_S**2, BANDWIDTH_HZ))
    write_estimate(tmp_path / "model.json", estimate)
    found = read_estimate(tmp_path / "model.json")
    assert found.channel is not None
    assert found.channel.bandwidth_hz == BANDWIDTH_HZ
    np.testing.assert_array_equal(found.channel.delay_s, LATE_S)
    assert found.model.nonlinear_names == ("dp_axis2",)
    # Along a path from rest the torque grows with the way, as slow as it may be.
    still = np.zeros((400, 3))
    way = np.linspace(0.0, 0.1, 400)[:, np.newaxis] * np.array([0.0, 1.0, 0.0])
    friction = predict(found, way, still, still) - predict(
        replace(found, values=found.values * (np.array(found.base.names) != "fc_axis2")),
        way,
        still,
        still,
    )
    coulomb = found.values[found.base.names.index("fc_axis2")]
    assert friction[0, 1] == 0.0
    assert np.all(np.diff(friction[:, 1]) >= -1e-9)
    assert friction[-1, 1] == pytest.approx(coulomb)
    head = python_function(ExportModel.identified(found)).partition("import numpy")[0]
    assert "Left out: presliding (dp_axis2" in " ".join(head.split())


def test_a_channel_for_other_joints_is_refused() -> None:
    with pytest.raises(EstimationError):
        TorqueChannel(np.zeros(3), np.zeros(2))
