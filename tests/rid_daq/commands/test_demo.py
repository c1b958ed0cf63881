from __future__ import annotations

import json
from pathlib import Path

import pytest

from rid_daq.app import run

pytestmark = pytest.mark.slow


def test_the_whole_demo_reaches_what_it_is_held_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["demo", "--json", "--runs", str(tmp_path)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["average"]["periods_kept"] == 16
    assert document["validation"]["has_floor"]
    assert all(axis["error_over_floor"] <= 1.3 for axis in document["validation"]["axes"])
    off = document["truth"][1]
    assert off["inside"] >= 0.9 * off["of"]
    assert len(document["verdict"]["checks"]) == 6
    circle, path = document["tracking"]["motions"]
    assert (circle["use"], path["use"]) == ("tuned on it", "never used")
    assert 1e-3 < circle["before"]["mean_m"] < 3e-3
    assert circle["mean_ratio"] > 10.0
    assert path["mean_ratio"] > 6.0
    page = Path(document["report"]).read_text()
    assert page.count("times as large") == 4
    assert [run["role"] for run in document["runs"]][2:] == [
        "Multisine",
        "Circle, plain",
        "Circle, compensated",
        "Path, plain",
        "Path, compensated",
    ]
