"""Rows 28 to 30 of docs/faults.md, end to end on the simulated cell with its amplifier."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.journal.plate import PLATE_RECORDING, PlateRows, read_plate_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.processing.plate_alignment import stream_clock, with_plate
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import DeviceProfiles, record_motion
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.load import LoadedCell, load_cell
from config.simulation.faults import AmplifierFault, FaultScript
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation

pytestmark = pytest.mark.slow

PERIOD_S, PERIODS, RATE_HZ = 2.0, 8, 1500


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def record(
    loaded: LoadedCell,
    folder: Path,
    *faults: AmplifierFault,
    cell: CellConfig | None = None,
    periods: int = PERIODS,
) -> tuple[RecordOutcome, Recording, PlateRows]:
    """Record a motion in lock-step with faults on the line of the amplifier."""
    joints = tuple(
        FourierJoint(joint=name, offset=offset, sine=(0.2,), cosine=(0.1,))
        for name, offset in zip(loaded.robot.joint_names, (0.1, -0.15, 0.2), strict=True)
    )
    motion = FourierMotion(
        kind="fourier",
        robot="ir361",
        period_s=PERIOD_S,
        periods=periods,
        ramp_s=1.0,
        joints=joints,
    )
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(
            cell or loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=False,
            seed=4,
            amplifier_profile=loaded.amplifier_profile,
            faults=FaultScript(seed=1, amplifier=faults),
        )
    ) as simulated:
        run = RunFolder.create(folder, "test")
        outcome = record_motion(
            simulated.cell,
            loaded.robot,
            samples,
            run,
            profiles=DeviceProfiles(loaded.amplifier_profile),
        )
    recording = read_journal(outcome.path).recording()
    return outcome, recording, read_plate_journal(run.file(PLATE_RECORDING))


def average_of(recording: Recording, rows: PlateRows) -> PeriodAverage:
    return average_periods(with_plate(recording, rows))


def first_row_of(recording: Recording, rows: PlateRows, period: int) -> int:
    """Return the first plate row of a main period."""
    begin_s = recording.time_s[recording.phase == Phase.MAIN][0] + period * PERIOD_S
    return int(np.searchsorted(stream_clock(recording, rows, 0).to_sync(rows.device_s), begin_s))


@pytest.fixture(scope="module")
def healthy(
    loaded: LoadedCell, tmp_path_factory: pytest.TempPathFactory
) -> tuple[RecordOutcome, Recording, PlateRows]:
    return record(loaded, tmp_path_factory.mktemp("healthy"))


Measured = Callable[[str], None]
Healthy = tuple[RecordOutcome, Recording, PlateRows]


@pytest.mark.fault(28)
def test_row_28_overloads_are_flagged_and_saturated_samples_are_not_averaged(
    loaded: LoadedCell, healthy: Healthy, tmp_path: Path, measured: Measured
) -> None:
    begin = first_row_of(healthy[1], healthy[2], 3) + 600
    fault = AmplifierFault(kind="overload", row=begin, duration_s=0.3, channel=4)
    outcome, recording, rows = record(loaded, tmp_path, fault)
    assert outcome.stop is None
    assert any("fz1 was overloaded; its range is 5000 N" in note for note in outcome.notes)
    full = loaded.config.plate.amplifier.full_scale_counts if loaded.config.plate else 0
    saturated = np.abs(rows.rows["counts"][:, 4].astype(int)) >= 0.95 * full
    assert saturated.sum() > 300
    assert rows.overload[saturated, 4].all()
    average = average_of(recording, rows)
    named = [p for p in average.rejected if "fz1" in p.reason]
    assert 3 in {p.index for p in named}
    assert average.reaction is not None
    good = average_of(healthy[1], healthy[2]).reaction
    assert good is not None
    off = np.abs(average.reaction.channels_n - good.channels_n)
    level = off.mean(axis=0)
    assert (off - level).max() < 2.0, "one saturated sample in the average of seven would add 700 N"
    measured(f"{saturated.sum()} saturated samples, all flagged, 0 averaged")


@pytest.mark.fault(28)
def test_row_28_more_than_three_overloaded_periods_stop_the_run(
    loaded: LoadedCell, tmp_path: Path, measured: Measured
) -> None:
    fault = AmplifierFault(kind="overload", row=4000, duration_s=1e5, channel=0)
    outcome, _, _ = record(loaded, tmp_path, fault, periods=30)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.PLATE_OVERLOAD
    assert any("fx12 was overloaded" in note and "larger" in note for note in outcome.notes)
    measured("more than 3 overloaded periods: stopped, a larger range suggested")


@pytest.mark.fault(29)
def test_row_29_exactly_the_periods_with_drift_beyond_the_limit_are_excluded(
    loaded: LoadedCell, healthy: Healthy, tmp_path: Path, measured: Measured
) -> None:
    """Drift of 1 N/s begins at 30 % of period 2 and lasts two periods; the limit is 0.5 N/s.

    Therefore the mean drifts of periods 2, 3 and 4 are 0.7, 1 and 0.3 N/s.
    """
    begin = first_row_of(healthy[1], healthy[2], 2) + int(0.3 * PERIOD_S * RATE_HZ)
    fault = AmplifierFault(kind="drift", row=begin, count=1, duration_s=2 * PERIOD_S, channel=6)
    outcome, recording, rows = record(loaded, tmp_path, fault)
    assert outcome.stop is None
    average = average_of(recording, rows)
    assert [p.index for p in average.rejected] == [2, 3]
    for period, rate in zip(average.rejected, (0.7, 1.0), strict=True):
        words = period.reason.split()
        assert period.reason.startswith("channel fz3 of the force plate drifted by")
        assert float(words[words.index("by") + 1]) == pytest.approx(rate, abs=0.1)
    measured("the 2 periods with more than 0.5 N/s left out, no other period")


def test_row_29_the_simulated_plates_own_drift_rejects_no_period(healthy: Healthy) -> None:
    average = average_of(healthy[1], healthy[2])
    assert average.rejected == ()
    assert average.reaction is not None
    assert average.reaction.left_out == ()
    assert np.abs(average.reaction.drift_n_s).max() > 0.03


@pytest.mark.fault(30)
def test_row_30_corrupted_bytes_lose_at_most_two_more_rows_than_they_hit(
    loaded: LoadedCell, healthy: Healthy, tmp_path: Path, measured: Measured
) -> None:
    faults = (
        AmplifierFault(kind="garbage", row=6000, count=300),
        AmplifierFault(kind="nuls", row=8000, count=20_000),
        AmplifierFault(kind="torn_row", row=10_000, count=3),
        AmplifierFault(kind="lost_bytes", row=12_000, count=5),
        AmplifierFault(kind="bad_checksum", row=14_000, count=2),
    )
    outcome, recording, rows = record(loaded, tmp_path, *faults)
    assert outcome.stop is None
    came = set(rows.sequence.tolist())
    lost = [k for k in range(int(rows.sequence[-1])) if k not in came]
    hit = {6000: 0, 8000: 0, 10_000: 3, 12_000: 1, 14_000: 2}
    for at, rows_hit in hit.items():
        near = [k for k in lost if at - 2 <= k <= at + rows_hit + 2]
        assert len(near) <= rows_hit + 2
    assert len(lost) <= sum(hit.values()) + 2 * len(hit)
    average = average_of(recording, rows)
    assert average.periods_kept >= PERIODS - 5
    by_number = dict(zip(healthy[2].sequence.tolist(), healthy[2].rows["counts"], strict=True))
    both = zip(rows.sequence.tolist(), rows.rows["counts"], strict=True)
    same = [np.array_equal(by_number[k], counts) for k, counts in both if k in by_number]
    assert all(same), "received rows equal sent rows"
    measured(f"{len(lost)} rows lost, {sum(hit.values())} damaged by the fault; 0 wrong values")


@pytest.mark.fault(30)
def test_row_30_an_unplugged_amplifier_stops_the_run(
    loaded: LoadedCell, tmp_path: Path, measured: Measured
) -> None:
    fault = AmplifierFault(kind="unplug", row=7000, duration_s=1e5)
    outcome, recording, rows = record(loaded, tmp_path, fault, periods=30)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.PLATE_LINE
    assert np.abs(np.diff(recording.position[-3:], axis=0)).max() < 1e-4
    assert len(rows.rows) <= 7000
    measured("amplifier unplugged: run stopped, axes at rest")


def test_the_same_seed_gives_the_same_file_up_to_the_last_sync(
    loaded: LoadedCell, healthy: Healthy, tmp_path: Path
) -> None:
    _, recording, rows = record(loaded, tmp_path)
    last_s = float(recording.time_s[-1])
    assert last_s == healthy[1].time_s[-1]
    one, two = (r.until(last_s) for r in (healthy[2], rows))
    assert one.rows.tobytes() == two.rows.tobytes()
    assert one.events.tobytes() == two.events.tobytes()
    assert len(one.rows) > PERIODS * PERIOD_S * RATE_HZ
    aligned = [with_plate(rec, r).reaction for rec, r in (healthy[1:], (recording, rows))]
    assert aligned[0] is not None
    assert aligned[1] is not None
    assert aligned[0].channels_n.tobytes() == aligned[1].channels_n.tobytes()


def test_a_wired_trigger_aligns_the_rows_with_sync(loaded: LoadedCell, tmp_path: Path) -> None:
    plate = loaded.config.plate
    assert plate is not None
    amplifier = plate.amplifier.model_copy(update={"trigger": True, "rate_hz": 1000.0})
    wired = plate.model_copy(update={"amplifier": amplifier})
    cell = loaded.config.model_copy(update={"plate": wired})
    _, recording, rows = record(loaded, tmp_path, cell=cell, periods=2)
    edges = rows.of_kind("trigger")
    assert len(edges) >= len(recording) - 5
    clock = stream_clock(recording, rows, 0)
    # the plate's clock is 3 ms ahead at time 0 and 100 ppm fast; a SYNC takes 50 us on the bus
    sync_s = recording.time_s[len(recording) // 2 :: 50]
    device_s = 0.003 + 1.0001 * sync_s
    late_s = clock.to_sync(device_s) - sync_s
    assert np.abs(late_s).max() < 1.5e-4
    assert np.ptp(late_s) < 1e-5
    assert with_plate(recording, rows).reaction is not None
