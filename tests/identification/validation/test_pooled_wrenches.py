"""Errors of the base wrench on several recordings are those of all their samples together."""

from __future__ import annotations

import numpy as np
import pytest

from identification.validation.base_wrench_validation import (
    BaseWrenchValidation,
    pool_base_wrenches,
)


def _compared(rows: int, error: float, size: float, noise: float | None) -> BaseWrenchValidation:
    wave = size * np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(rows) / rows)
    predicted = np.repeat(wave[:, np.newaxis], 6, axis=1)
    sign = np.where(np.arange(rows) % 2, 1.0, -1.0)[:, np.newaxis]
    return BaseWrenchValidation(
        time_s=np.asarray(0.01 * np.arange(rows), dtype=np.float64),
        measured=predicted + error * sign,
        predicted=predicted,
        counted=np.ones(rows, dtype=np.bool_),
        rms=np.full(6, error),
        relative_percent=np.full(6, 100.0 * error / size),
        noise=None if noise is None else np.full(6, noise),
        delay_s=0.001,
        cutoff_hz=10.0,
    )


def test_each_sample_has_the_same_weight() -> None:
    pooled = pool_base_wrenches([_compared(300, 1.0, 20.0, 0.1), _compared(100, 3.0, 10.0, 0.3)])
    error = (pooled.measured - pooled.predicted)[pooled.counted]
    assert len(error) == 400
    assert pooled.rms == pytest.approx(np.sqrt(np.mean(error**2, axis=0)))
    size = np.sqrt((300 * 20.0**2 + 100 * 10.0**2) / 400)
    assert pooled.relative_percent == pytest.approx(100.0 * pooled.rms / size)
    assert pooled.noise == pytest.approx(np.full(6, np.sqrt((300 * 0.01 + 100 * 0.09) / 400)))


def test_the_noise_is_unknown_if_that_of_one_recording_is() -> None:
    pooled = pool_base_wrenches([_compared(100, 1.0, 20.0, 0.1), _compared(100, 1.0, 20.0, None)])
    assert pooled.noise is None
