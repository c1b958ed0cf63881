from __future__ import annotations

import json
from pathlib import Path

import pytest

from rid_daq.app import run
from tests.builders.screens import noted, require_fitting

pytestmark = pytest.mark.slow


NUMBERS = Path(__file__).with_name("demo_numbers.json")
SECTIONS = (
    *("average", "estimate", "validation", "tracking", "retiming", "truth"),
    "without_unmodelled",
)


def numbers(value: object, place: str) -> dict[str, float]:
    """Return the numbers of a result by where they stand, without the curves of pictures."""
    if isinstance(value, bool | str) or value is None:
        return {}
    if isinstance(value, int | float):
        return {place: value}
    assert isinstance(value, dict | list)
    found: dict[str, float] = {}
    for key, part in value.items() if isinstance(value, dict) else enumerate(value):
        if key not in ("drawn", "ways"):
            found |= numbers(part, f"{place}.{key}")
    return found


def test_the_whole_demo_reaches_what_it_is_held_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with noted() as calls:
        assert run(["demo", "--json", "--runs", str(tmp_path)]) == 0
    require_fitting(["demo"], calls)
    document = json.loads(capsys.readouterr().out)
    found = {place: n for key in SECTIONS for place, n in numbers(document[key], key).items()}
    # bit by bit on one computer; another one's arithmetic may round otherwise
    assert found == pytest.approx(json.loads(NUMBERS.read_text()), rel=1e-6, abs=1e-12)
    assert document["average"]["periods_kept"] == 16
    assert document["validation"]["has_floor"]
    assert all(axis["error_over_floor"] <= 1.3 for axis in document["validation"]["axes"])
    off = document["truth"][1]
    assert off["inside"] >= 0.9 * off["of"]
    assert len(document["verdict"]["checks"]) == 11
    assert all(check["passed"] for check in document["verdict"]["checks"])
    circle, path = document["tracking"]["motions"]
    assert (circle["use"], path["use"]) == ("tuned on it", "never used")
    assert 1e-3 < circle["before"]["mean_m"] < 3e-3
    assert circle["mean_ratio"] > 10.0
    assert path["mean_ratio"] > 6.0
    driven = document["retiming"]["driven"]
    before, after = driven["before"], driven["after"]
    assert after["moving_s"] < 0.8 * before["moving_s"]
    assert 0.9 < max(after["torque_share"]) <= 1.02
    assert 0.9 < max(after["base_peak"][k] / driven["limit"][k] for k in range(5)) <= 1.0
    assert after["mean_m"] < 3.0 * before["mean_m"]
    assert after["max_m"] < 3.0 * before["max_m"]
    page = Path(document["report"]).read_text()
    assert "As it was driven" in page
    assert "as measured (dotted)" in page
    assert page.count("times as large") == 4
    assert [run["role"] for run in document["runs"]][2:] == [
        "Multisine",
        "Circle, plain",
        "Circle, compensated",
        "Path, plain",
        "Path, compensated",
        "Excitation on the plate",
        "Pick-and-place",
        "Timed",
    ]
