from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.mcap_reader import JournalDamage
from acquisition.journal.plate import EVENT_DTYPE, ROW_DTYPE, PlateHeader, PlateRows
from acquisition.motion.samples import Phase
from acquisition.processing.plate_alignment import plate_defects, stream_clock, with_plate
from acquisition.recording.recording import Recording
from config.cell.amplifier_profile import AmplifierProfile
from config.errors import DataQualityError
from config.load import load_bundled_or_path, load_cell
from tests.builders.raised_codes import raises_code

CYCLE_S, RATE_HZ, SAMPLES = 0.008, 1500.0, 2500
PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)


@pytest.fixture
def recording() -> Recording:
    at = np.arange(SAMPLES, dtype=np.float64) * CYCLE_S
    still = np.zeros((SAMPLES, 1))
    return Recording(
        joint_names=("j1",),
        time_s=700.0 + at,
        position=still,
        torque_nm=still,
        valid=np.ones(SAMPLES, dtype=np.bool_),
        phase=np.full(SAMPLES, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(SAMPLES),
        source="cell",
        sample_period_s=CYCLE_S,
    )


def header(**amplifier: Any) -> PlateHeader:
    plate = load_cell("ir361").config.plate
    assert plate is not None
    settings = plate.amplifier.model_copy(update=amplifier)
    return PlateHeader(
        plate=plate.model_copy(update={"amplifier": settings}), profile=PROFILE, cell_name="ir361"
    )


def to_sync(device_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return 699.0 + 0.003 + device_s * (1.0 + 1e-4)


def force(sync_s: NDArray[np.float64]) -> NDArray[np.float64]:
    return 100.0 * np.sin(2.0 * np.pi * 1.3 * sync_s)


def stream(first_s: float, last_s: float, number: int = 0, seed: int = 0) -> NDArray[Any]:
    """Return plate rows whose channels all follow one sine; their clock starts with the stream."""
    random = np.random.default_rng(seed)
    device = np.arange(first_s, last_s, 1.0 / RATE_HZ)
    rows = np.zeros(len(device), dtype=ROW_DTYPE)
    late = 28 * 10 / 460_800 + random.uniform(0.0, 0.005, len(device))
    rows["arrival_s"] = np.maximum.accumulate(to_sync(device) + late)
    rows["device_s"] = np.round(device - first_s, 6)
    rows["sequence"] = np.arange(len(device))
    per_count = np.array(header().plate.amplifier.newtons_per_count)
    rows["counts"] = np.round(force(to_sync(device))[:, np.newaxis] / per_count)
    rows["stream"] = number
    rows["status"] = 1 << PROFILE.status_bits.operate
    return rows


def plate_rows(
    rows: NDArray[Any], events: NDArray[Any] | None = None, **amplifier: Any
) -> PlateRows:
    none = np.zeros(0, dtype=EVENT_DTYPE)
    damage = JournalDamage(True, (), 0)
    return PlateRows(header(**amplifier), rows, none if events is None else events, damage)


def test_plate_rows_are_resampled_at_the_recordings_times(recording: Recording) -> None:
    measured = with_plate(recording, plate_rows(stream(0.0, 23.0))).reaction
    assert measured is not None
    assert measured.valid.all()
    assert measured.clock is not None
    assert measured.clock.drift_ppm == pytest.approx(100.0, abs=2.0)
    error = measured.channels_n - force(recording.time_s)[:, np.newaxis]
    assert np.abs(error).max() < 0.15  # half a count, plus 50 us at 820 N/s


def test_a_stream_after_a_lost_connection_has_its_own_clock(recording: Recording) -> None:
    rows = np.concatenate([stream(0.0, 9.0), stream(12.0, 23.0, 1)])
    measured = with_plate(recording, plate_rows(rows)).reaction
    assert measured is not None
    at = recording.time_s - to_sync(np.zeros(1))[0]
    assert not measured.valid[(at > 9.0) & (at < 12.0)].any()
    assert measured.valid[(at > 1.0) & (at < 8.8)].all()
    assert measured.valid[(at > 12.2) & (at < 20.0)].all()
    error = measured.channels_n - force(recording.time_s)[:, np.newaxis]
    assert np.abs(error[measured.valid]).max() < 0.2


def test_rows_with_overload_or_reset_are_invalid(recording: Recording) -> None:
    rows = stream(0.0, 23.0)
    rows["status"][9000:9010] |= 1 << 4
    rows["status"][20000:20010] = 0
    measured = with_plate(recording, plate_rows(rows)).reaction
    assert measured is not None
    fz1, others = ~measured.valid[:, 4], ~np.delete(measured.valid, 4, axis=1)
    assert fz1.sum() > others[:, 0].sum() > 0
    at = np.searchsorted(recording.time_s, to_sync(np.array([9005, 20005]) / RATE_HZ))
    assert fz1[at].all()
    assert (others.all(axis=1) == others.any(axis=1)).all()
    assert others[at[1]].all()
    assert not others[at[0]].any()


def test_reset_overload_and_clipping_are_named(recording: Recording) -> None:
    rows = stream(0.0, 23.0)
    assert plate_defects(recording, plate_rows(rows)) == ()
    rows["status"][:3000] = 0  # until 1 s after the first row of the recording
    rows["status"][9000:9300] |= 1 << 4
    largest = int(rows["counts"][:, 2].max())
    rows["counts"][:, 2] = np.minimum(rows["counts"][:, 2], 0.8 * largest)
    reset, fy14, fz1 = plate_defects(recording, plate_rows(rows))
    assert "5 % of the recording" in reset
    assert f"fy14 reads exactly {int(0.8 * largest)} " in fy14
    assert "fz1 was overloaded in 1.1 %" in fz1


def test_a_wired_trigger_gives_the_best_clock(recording: Recording) -> None:
    rows = stream(0.0, 23.0)
    edges = np.zeros(SAMPLES, dtype=EVENT_DTYPE)
    edges["kind"] = PROFILE.events.trigger
    edges["device_s"] = (recording.time_s - 699.003) / (1.0 + 1e-4)
    clock = stream_clock(recording, plate_rows(rows, edges, trigger=True), 0)
    assert clock.method == "edges"
    found = clock.to_sync(rows["device_s"])
    np.testing.assert_allclose(found, to_sync(rows["device_s"]), atol=2e-6)
    assert stream_clock(recording, plate_rows(rows, edges), 0).method == "arrivals"


def test_marks_are_used_if_they_are_more_accurate(recording: Recording) -> None:
    rows = stream(0.0, 23.0)
    rows["arrival_s"] += np.random.default_rng(5).gamma(4.0, 0.01, len(rows))
    rows["arrival_s"] = np.maximum.accumulate(rows["arrival_s"])
    marks = np.zeros(23, dtype=EVENT_DTYPE)
    marks["kind"] = PROFILE.events.mark
    marks["device_s"] = np.arange(23.0)
    marks["asked_s"] = to_sync(marks["device_s"]) - 0.0002
    marks["arrival_s"] = to_sync(marks["device_s"]) + 0.0003
    clock = stream_clock(recording, plate_rows(rows, marks), 0)
    assert clock.method == "marks"
    assert np.abs(clock.to_sync(rows["device_s"]) - to_sync(rows["device_s"])).max() < 1e-4
    simulated = replace(
        plate_rows(rows, marks), header=header().model_copy(update={"simulated_time": True})
    )
    assert stream_clock(recording, simulated, 0).method == "arrivals"


def test_a_plate_without_enough_rows_is_refused(recording: Recording) -> None:
    with raises_code(DataQualityError, "RID-PLATE-CLOCK", "used"):
        with_plate(recording, plate_rows(stream(0.0, 0.0)))
    with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
        with_plate(recording, plate_rows(stream(0.0, 0.01)))
