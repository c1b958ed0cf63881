from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.signals.clocks import (
    DeviceClock,
    clock_from_arrivals,
    clock_from_edges,
    clock_from_marks,
    match_edges,
)
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

PPM, OFFSET_S, JITTER_S, LENGTH_S = 100.0, 0.003, 0.005, 170.0


def device_time(rate_hz: float) -> NDArray[np.float64]:
    """Return the times of rows on the device's clock [s], rounded to the 1 us that it sends."""
    return np.round(np.arange(0.0, LENGTH_S, 1.0 / rate_hz), 6)


def on_sync(device_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the true times on the host's clock, which has another rate and another offset."""
    return 9000.0 + OFFSET_S + device_s * (1.0 + 1e-6 * PPM)


class TestArrivals:
    @pytest.mark.parametrize("rate_hz", [125.0, 480.0, 960.0])
    @pytest.mark.parametrize("law", ["uniform", "exponential", "read in chunks"])
    def test_rows_over_170_s_with_5_ms_of_jitter_are_located_within_50_us(
        self, rate_hz: float, law: str
    ) -> None:
        random = np.random.default_rng(3)
        device = device_time(rate_hz)
        true = on_sync(device)
        if law == "uniform":
            arrival = np.maximum.accumulate(true + random.uniform(0.0, JITTER_S, len(true)))
        elif law == "exponential":
            arrival = np.maximum.accumulate(true + random.exponential(JITTER_S / 3.0, len(true)))
        else:
            reads = true[0] + np.cumsum(random.uniform(0.002, 2 * JITTER_S, 60_000))
            arrival = reads[np.searchsorted(reads, true)]
        clock = clock_from_arrivals(device, arrival)
        error = np.abs(clock.to_sync(device) - true)
        assert error.max() < 50e-6
        assert clock.drift_ppm == pytest.approx(PPM, abs=0.6)
        assert (error < 3.0 * clock.sigma_s(device) + 1e-8).all()
        assert clock.sigma_s(device).max() < 200e-6

    def test_the_uncertainty_covers_the_error_if_short_delays_are_rare(self) -> None:
        """The sum of two random delays is almost never zero, so even the earliest arrivals are
        late.
        """
        device = device_time(125.0)
        true, inside = on_sync(device), []
        for seed in range(12):
            delay = np.random.default_rng(seed).gamma(2.0, JITTER_S / 4.0, len(true))
            clock = clock_from_arrivals(device, np.maximum.accumulate(true + delay))
            error = np.abs(clock.to_sync(device) - true)[[0, len(device) // 2, -1]]
            inside.append(error < 2.0 * clock.sigma_s(device)[[0, len(device) // 2, -1]])
        assert np.mean(inside) > 0.9

    def test_a_known_minimum_delay_is_subtracted(self) -> None:
        device = device_time(125.0)
        arrival = on_sync(device) + 0.004
        clock = clock_from_arrivals(device, arrival, shortest_delay_s=0.004)
        np.testing.assert_allclose(clock.to_sync(device), on_sync(device), atol=2e-6)

    def test_a_wandering_clock_is_reported(self) -> None:
        device = device_time(480.0)
        wandering = on_sync(device) + 0.001 * np.sin(device / 20.0)
        jitter = np.random.default_rng(0).uniform(0.0, 0.0005, len(device))
        clock = clock_from_arrivals(device, wandering + jitter)
        error = clock.to_sync(device) - wandering
        assert clock.wander_s > 2e-4
        assert np.abs(error).max() < 4.0 * clock.wander_s

    @pytest.mark.parametrize("rows", [0, 1, 30])
    def test_too_few_rows_are_refused(self, rows: int) -> None:
        device = np.arange(float(rows))
        with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
            clock_from_arrivals(device, device + 0.1)

    def test_time_stamps_in_another_unit_are_refused(self) -> None:
        device = device_time(125.0)
        with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
            clock_from_arrivals(device * 1000.0, on_sync(device))


class TestMarks:
    def test_marks_bound_the_clock_although_the_two_delays_differ(self) -> None:
        random = np.random.default_rng(1)
        device = np.linspace(0.0, LENGTH_S, 60)
        true = on_sync(device)
        to_device_s, to_host_s = (
            random.uniform(0.0002, 0.004, 60),
            random.uniform(0.0002, 0.009, 60),
        )
        clock = clock_from_marks(true - to_device_s, device, true + to_host_s)
        error = np.abs(clock.to_sync(device) - true)
        assert error.max() < 0.4e-3
        assert (error < 2.0 * clock.sigma_s(device)).all()

    def test_marks_that_no_linear_clock_fits_are_refused(self) -> None:
        device = np.linspace(0.0, 10.0, 20)
        true = device + 0.01 * (device > 5.0)
        with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
            clock_from_marks(true - 0.001, device, true + 0.001)

    def test_a_mark_with_an_answer_before_the_request_is_refused(self) -> None:
        device = np.arange(5.0)
        with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
            clock_from_marks(device + 0.1, device, device)


class TestEdges:
    def test_edges_give_the_clock_within_microseconds(self) -> None:
        random = np.random.default_rng(2)
        device = device_time(125.0)
        late = np.abs(random.normal(0.0, 20e-6, len(device)))
        late[::50] += 0.003  # some SYNC frames were delayed on the bus
        clock = clock_from_edges(device, on_sync(device) + late)
        error = clock.to_sync(device) - on_sync(device)
        assert np.abs(error - error.mean()).max() < 5e-6
        assert np.abs(error).max() < 30e-6  # the edge of SYNC is late by the mean delay

    def test_edges_are_matched_by_a_coarse_clock(self) -> None:
        sync = on_sync(device_time(125.0))
        device = np.delete(device_time(125.0), [5, 6, 900])
        device = np.sort(np.append(device, 31.4165))  # a glitch
        coarse = DeviceClock(0.0, on_sync(np.zeros(1))[0] + 0.001, 1.0001, np.eye(2), 0.0, "marks")
        edges, cycles = match_edges(device, sync, coarse, within_s=0.002)
        assert len(edges) == len(device) - 1
        np.testing.assert_allclose(on_sync(device[edges]), sync[cycles], atol=1e-9)

    def test_too_few_edges_are_refused(self) -> None:
        with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
            clock_from_edges(np.arange(2.0), np.arange(2.0))
