from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from tests.builders.invented import whole_result


@pytest.fixture(scope="session")
def six_axis_motion(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Return what writes a short motion of the six-axis cell, of so many periods, to a file."""

    def written(periods: int) -> Path:
        cell = load_cell("kr15")
        asked = design_two_harmonic(
            cell.robot,
            TwoHarmonicOptions(
                3.216, highest_harmonic=4, limit_fraction=0.35, tries=8, seed=3, periods=periods
            ),
            cell.config.cycle_time_s,
        )
        path = tmp_path_factory.mktemp("motion") / "motion.yaml"
        path.write_text(to_yaml(asked), encoding="utf-8")
        return path

    return written


@pytest.fixture
def runs(workshop: Path) -> list[str]:
    """The option that names the runs of a file's own `workshop`."""
    return ["--runs", str(workshop / "runs")]


@pytest.fixture
def result() -> dict[str, Any]:
    """A whole result document with invented numbers: every section of the report is there."""
    return whole_result()
