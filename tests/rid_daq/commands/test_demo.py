from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rid_daq.app import run
from tests.builders.screens import recorded_calls, require_fitting

pytestmark = pytest.mark.slow


ANY = float("inf")
# By place in the document: lowest and highest allowed number, and count of the numbers.
BOUNDS: dict[str, tuple[float, float, int]] = {
    "average.samples_per_period": (1250, 1250, 1),
    "average.missing_samples": (0, 0, 1),
    "average.axes.*.torque_noise": (0.3, 2.0, 3),
    "average.axes.*.position_noise": (1e-7, 5e-6, 3),
    "estimate.condition_number": (10.0, 60.0, 1),
    "estimate.equations": (400, 700, 1),
    "estimate.axes.*.percent": (0.1, 1.0, 3),
    "estimate.axes.*.over_noise": (1.0, 5.0, 3),
    "validation.axes.*.relative_error_percent": (0.5, 2.0, 3),
    "validation.axes.*.all_samples_percent": (1.0, 5.0, 3),
    "validation.axes.*.error_over_floor": (0.5, 1.0, 3),
    "tracking.motions.*.before.mean_m": (1e-3, 4e-3, 2),
    "tracking.motions.*.after.mean_m": (0.0, 1e-4, 2),
    "tracking.motions.*.after.max_m": (0.0, 1e-3, 2),
    "tracking.motions.*.mean_ratio": (20.0, ANY, 2),
    "tracking.motions.*.max_ratio": (7.0, ANY, 2),
    "retiming.moving_s": (0.9, 1.1, 1),
    "retiming.joints.*.speed_share": (0.0, 1.0, 3),
    "retiming.joints.*.acceleration_share": (0.0, 1.0, 3),
    "elastic_path.rigid.estimated.tool_mean_m": (1e-3, 3e-3, 1),
    "elastic_path.corrected.estimated.tool_mean_m": (0.0, 5e-5, 1),
    "elastic_path.rigid.measured_mean_m": (2.5e-4, 5e-4, 1),
    "elastic_path.corrected.measured_mean_m": (0.0, 2.2e-4, 1),
    "elastic_path.largest_deflection.*": (2e-4, 3e-3, 3),
    "without_unmodelled.estimate.condition_number": (10.0, 80.0, 1),
    "without_unmodelled.estimate.parameters.*.deviation_sigmas": (-3.5, 3.5, 23),
    "without_unmodelled.estimate.axes.*.percent": (0.05, 0.5, 3),
    # 0.9; up to 1.8 if a drive's heartbeat meets SYNC, and delays it by 56 us every 200 ms
    "without_unmodelled.estimate.axes.*.over_noise": (0.7, 2.0, 3),
    "without_unmodelled.validation.axes.*.relative_error_percent": (0.5, 2.0, 3),
    "without_unmodelled.validation.axes.*.error_over_floor": (0.95, 1.05, 3),
}


def numbers_at(value: Any, place: str) -> list[float]:
    """Return the numbers of a document at a place; `*` means every element of a list."""
    key, _, rest = place.partition(".")
    parts = value if key == "*" else [value[key]]
    return [n for part in parts for n in (numbers_at(part, rest) if rest else [part])]


@pytest.mark.usefixtures("drawn_reports")
def test_the_demo_keeps_the_bounds_of_all_its_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with recorded_calls() as calls:
        assert run(["demo", "--json", "--runs", str(tmp_path)]) == 0
    require_fitting(["demo"], calls)
    document = json.loads(capsys.readouterr().out)
    for place, (lowest, highest, count) in BOUNDS.items():
        found = numbers_at(document, place)
        assert len(found) == count, place
        assert all(lowest <= n <= highest for n in found), (place, found)
    for joint in document["retiming"]["joints"]:
        assert joint["torque_uncertain_peak"] <= joint["torque_limit"]
    for base in document["retiming"]["base"]:
        assert base["peak"] + base["margin"] <= base["limit"] * (1.0 + 1e-6)
    assert document["average"]["periods_kept"] == 16
    assert document["validation"]["has_floor"]
    off = document["truth"][1]
    assert off["inside"] >= 0.9 * off["of"]
    assert len(document["verdict"]["checks"]) == 13
    assert all(check["passed"] for check in document["verdict"]["checks"])
    circle, path = document["tracking"]["motions"]
    assert (circle["use"], path["use"]) == ("tuned on it", "never used")
    assert circle["mean_ratio"] > path["mean_ratio"]
    driven = document["retiming"]["driven"]
    before, after = driven["before"], driven["after"]
    assert after["moving_s"] < 0.8 * before["moving_s"]
    assert 0.9 < max(after["torque_share"]) <= 1.02
    assert 0.9 < max(after["base_peak"][k] / driven["limit"][k] for k in range(5)) <= 1.0
    assert after["mean_m"] < 3.0 * before["mean_m"]
    assert after["max_m"] < 3.0 * before["max_m"]
    page = Path(document["report"]).read_text()
    assert "Measured on the robot" in page
    assert "Dotted: measured torques" in page
    assert page.count("deviation magnified ") == 4
    assert [run["role"] for run in document["runs"]][2:] == [
        "Multisine",
        "Circle, plain",
        "Circle, compensated",
        "Path, plain",
        "Path, compensated",
        "Excitation on the plate",
        "Pick-and-place",
        "Timed",
        "Excitation, elastic gears",
        "Multisine, elastic gears",
        "Circle, rigid, elastic gears",
        "Circle, corrected, elastic gears",
    ]
