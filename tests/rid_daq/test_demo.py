from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rid_daq.app import run


# One cell is held by one session at a time, so these tests share a worker.
def _demo(root: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    words = ["demo", "--seed", "3", "--periods", "2", "--points", "2", "--no-paths", "--json"]
    assert run([*words, "--runs", str(root)]) in (0, 1)  # so short, it may miss its own limits
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


def test_the_same_seed_gives_the_same_numbers_bit_for_bit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = (_demo(tmp_path / name, capsys) for name in ("first", "second"))
    for document in (first, second):
        report = Path(document.pop("report"))
        folder = Path(document.pop("folder"))
        assert report.parent == folder
        assert json.loads((folder / "result.json").read_text()) == document
        document.pop("timing")
    assert first == second

    on, off = first["truth"]
    assert on["of"] == off["of"] == 23
    assert 0 < off["inside"] <= 23
    assert [check["limit"] for check in first["verdict"]["checks"]] == [1.3, 90.0]
    assert all(axis["error_over_floor"] < 1.3 for axis in first["validation"]["axes"])


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
