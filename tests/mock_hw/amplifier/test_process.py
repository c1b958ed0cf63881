"""An amplifier alone in a process: the driver talks to it, and it ends with its starter."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config.errors import TransportError
from config.load import load_cell
from drivers.amplifier.amplifier import open_amplifier
from mock_hw.amplifier.port import PlateSettings
from mock_hw.amplifier.process import ServedAmplifier, SwingingLoad

ENOUGH_S = 120.0


def settings_at(path: Path) -> PlateSettings:
    loaded = load_cell("ir361")
    assert loaded.config.plate is not None
    assert loaded.plant is not None
    assert loaded.plant.plate is not None
    assert loaded.amplifier_profile is not None
    return PlateSettings(loaded.config.plate, loaded.amplifier_profile, loaded.plant.plate, path)


def test_the_driver_reads_a_swinging_load_in_real_time(tmp_path: Path) -> None:
    settings = settings_at(tmp_path / "amplifier")
    load = SwingingLoad(amplitude=(0.0, 0.0, 400.0, 0.0, 0.0, 0.0), frequency_hz=20.0)
    with ServedAmplifier(settings, load) as address:
        config = settings.plate.amplifier.model_copy(update={"address": address})
        with open_amplifier(config, settings.profile) as amplifier:
            amplifier.connect()
            amplifier.configure()
            amplifier.operate()
            amplifier.start()
            rows: list[NDArray[Any]] = []
            while sum(map(len, rows)) < 300:
                rows.append(amplifier.read(time.monotonic() + ENOUGH_S).rows)
        counts = np.concatenate(rows)["counts"][-200:, 4:]
        swing_n = np.ptp(counts, axis=0) * 5000.0 / 2**15
        np.testing.assert_allclose(swing_n, 200.0, rtol=0.1)
        with pytest.raises(TransportError, match="did not start"):
            ServedAmplifier(settings).__enter__()
    assert [*tmp_path.iterdir()] == []


def test_a_load_swings_about_its_constant() -> None:
    load = SwingingLoad(frequency_hz=0.25)
    wrench = load.at(np.array([0.0, 1.0, 3.0]))
    np.testing.assert_allclose(wrench[0], load.constant)
    np.testing.assert_allclose(wrench[1] - wrench[0], load.amplitude)
    np.testing.assert_allclose(wrench[2] - wrench[0], -np.array(load.amplitude))
