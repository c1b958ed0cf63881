"""Errors of an instrument's clock, frame and geometry do not count as deflection of the gears.

Pinocchio computes the measured point of an arm that is off its nominal geometry.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.signals.bins import to_bins
from acquisition.tracker.link_file import LinkPositions
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.load import load_bundled_or_path, load_robot
from config.simulation.plant import PlantConfig
from dynamics.geometry.kinematics import Chain
from identification.elasticity.elastic_runs import ExcitationBins
from identification.elasticity.instrument_unknowns import InstrumentUnknowns
from mock_hw.plant.tracker import Tracker
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
PERIOD_S, STEP_S, PERIODS, HARMONICS = 8.0, 0.008, 4, 40
RUN_IN_S = 4.0
TIME_S: FloatArray = np.arange(-RUN_IN_S, PERIODS * PERIOD_S - 0.5 * STEP_S, STEP_S)
NOISE_M = 5e-5


def motors(time_s: FloatArray) -> FloatArray:
    """Return a motion (rows, 3) in rad that starts from rest and is periodic from time 0 on."""
    share = np.clip(1.0 + time_s / RUN_IN_S, 0.0, 1.0)[:, np.newaxis]
    turn = 2.0 * np.pi * time_s[:, np.newaxis] / PERIOD_S
    return (
        share**3
        * (10.0 - 15.0 * share + 6.0 * share**2)
        * np.hstack(
            [
                0.6 * np.sin(turn) + 0.3 * np.cos(3.0 * turn),
                -0.4 + 0.5 * np.cos(2.0 * turn) + 0.2 * np.sin(5.0 * turn),
                0.5 + 0.6 * np.sin(3.0 * turn) + 0.2 * np.cos(4.0 * turn),
            ]
        )
    )


def bend(time_s: FloatArray) -> FloatArray:
    """Return the deflection of the gears (rows, 3) in rad, with an amplitude of 1 mrad."""
    turn = 2.0 * np.pi * time_s[:, np.newaxis] / PERIOD_S
    return 1e-3 * np.hstack([np.cos(4.0 * turn), np.cos(7.0 * turn), np.sin(6.0 * turn)])


@pytest.fixture(scope="module")
def recording() -> Recording:
    rows = len(TIME_S)
    return Recording(
        joint_names=ROBOT.joint_names,
        time_s=TIME_S,
        position=motors(TIME_S),
        torque_nm=np.zeros((rows, 3)),
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.where(TIME_S < -1e-9, Phase.RUN_IN, Phase.MAIN).astype(np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=STEP_S,
        samples_per_period=round(PERIOD_S / STEP_S),
    )


@pytest.fixture(scope="module")
def run() -> ExcitationBins:
    """Return the excitation run without instruments; its torques are not used."""
    period = motors(np.arange(0.0, PERIOD_S - 0.5 * STEP_S, STEP_S))
    none = np.zeros((HARMONICS, 3), dtype=complex)
    friction = np.zeros((HARMONICS, 3, 1), dtype=complex)
    return ExcitationBins("run", PERIOD_S, to_bins(period, HARMONICS), none, np.ones(3), friction)


@pytest.fixture(scope="module")
def tracked() -> TrackedPoint:
    """Return a tracker's rows; the geometry, clock, frame and point differ from nominal."""
    plant = load_bundled_or_path("ir361_elastic", "plants", PlantConfig)
    assert plant.tracker is not None
    changed = plant.tracker.model_copy(update={"noise_m": NOISE_M})
    tracker = Tracker(ROBOT, plant.model_copy(update={"tracker": changed}), 5)

    def state(at_s: float) -> tuple[FloatArray, FloatArray]:
        at = np.array([at_s - 1e-4, at_s + 1e-4])
        q = motors(at) - bend(at)
        return q.mean(axis=0), (q[1] - q[0]) / 2e-4

    tracker.begin(TIME_S[0], *state(TIME_S[0]))
    rows = np.array([row for at_s in TIME_S[1:] for row in tracker.observe(at_s, *state(at_s))])
    return TrackedPoint(rows[:, 0], rows[:, 1:])


def rms_left(run: ExcitationBins, q: FloatArray) -> float:
    """Return the RMS residual after the instrument's unknowns were eliminated [m or rad]."""
    unknowns = InstrumentUnknowns.of([run])
    runs: tuple[ExcitationBins, ...] = (run,)
    (each,) = run.link_side
    sigma = np.repeat(each.sigma, 2 * len(each.bins))

    def left() -> FloatArray:
        (each,) = runs[0].link_side
        bins = each.bins - each.predicted(q, PERIOD_S)
        return np.concatenate([bins.real, bins.imag]).T.ravel()

    for _ in range(3):
        runs = unknowns.renewed(runs, left(), sigma)
    basis = unknowns.basis(runs, sigma)
    weighted = left() / sigma
    weighted -= basis @ (basis.T @ weighted)
    return float(np.sqrt(2.0 * np.sum((weighted * sigma) ** 2)))


def grid(run: ExcitationBins) -> FloatArray:
    return np.linspace(0.0, PERIOD_S, run.rows, endpoint=False)


def test_a_tracker_shows_the_deflection_and_not_the_geometry(
    run: ExcitationBins, recording: Recording, tracked: TrackedPoint
) -> None:
    seen = run.with_tracker(tracked, recording, Chain.from_description(ROBOT))
    time_s = grid(seen)
    right = rms_left(seen, motors(time_s) - bend(time_s))
    rigid = rms_left(seen, motors(time_s))
    soft = rms_left(seen, motors(time_s) - 0.98 * bend(time_s))
    # 40 harmonics of 3 coordinates, each with the noise of the mean of all rows
    measured_s = tracked.time_s[-1] - tracked.time_s[0] - RUN_IN_S
    noise = NOISE_M * np.sqrt(3 * 2 * HARMONICS / (250.0 * measured_s))
    assert right == pytest.approx(noise, rel=0.2)
    assert rigid > 4e-4
    assert soft > 1.3 * right


def test_link_encoders_show_the_deflection_on_their_own_clock(
    run: ExcitationBins, recording: Recording
) -> None:
    own = np.arange(TIME_S[0], TIME_S[-1], 0.0031)
    links = LinkPositions(own + 90.0, (0, 2), (motors(own) - bend(own))[:, [0, 2]] - 1.0)
    seen = run.with_link_encoders(links, recording)
    time_s = grid(seen)
    assert rms_left(seen, motors(time_s) - bend(time_s)) < 1e-6
    assert rms_left(seen, motors(time_s)) == pytest.approx(1e-3, rel=0.1)


def test_a_slow_instrument_is_refused(
    run: ExcitationBins, recording: Recording, tracked: TrackedPoint
) -> None:
    slow = slice(0, None, 80)
    few = replace(tracked, time_s=tracked.time_s[slow], point_m=tracked.point_m[slow])
    with raises_code(DataQualityError, "RID-TRACKER-RATE"):
        run.with_tracker(few, recording, Chain.from_description(ROBOT))
