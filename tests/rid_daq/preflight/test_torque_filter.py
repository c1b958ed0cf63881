"""The preflight says if the drives' torque filter passes frequencies that alias."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config.load import load_cell
from rid_daq.preflight.preflight import lines_before_bus


@pytest.mark.parametrize(("cycle_ms", "shown"), [(8.0, []), (20.0, ["shown"])])
def test_a_filter_above_half_the_cycle_frequency_is_shown(
    cycle_ms: float, shown: list[str], tmp_path: Path
) -> None:
    loaded = load_cell("ir361")  # its drives filter the torque at 40 Hz
    config = loaded.config.model_copy(update={"cycle_time_ms": cycle_ms})
    lines = lines_before_bus(replace(loaded, config=config), tmp_path)
    found = [line for line in lines if line.what == "torque_filter.cutoff_hz"]
    assert [line.verdict for line in found] == shown
    assert ["25 Hz" in line.required for line in found] == [True] * len(shown)
