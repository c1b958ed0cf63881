"""`identify` finds the run in which the robot carried a payload that nothing states."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.runs.catalogue import find_run
from rid_daq.app import run
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_body import link_parameters

pytestmark = pytest.mark.usefixtures("plain_reports")

LINK_3 = link_parameters(3)
TOOL = 0.1
"""The payload relative to the last link, of 22.0 kg."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two runs without payload, and one with a tool."""
    root, arm = tmp_path_factory.mktemp("unstated"), arm_in_motion()
    identified_run(root, arm, "empty", 1)
    identified_run(root, arm, "again", 2)
    identified_run(root, arm, "tool", 3, **dict.fromkeys(LINK_3, 1.0 + TOOL))
    return root


@pytest.mark.parametrize("names", [("empty", "tool"), ("tool", "empty", "again")])
def test_a_payload_in_one_of_the_runs_is_found(
    runs: Path, names: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", *names, "--runs", str(runs), "--json", "-o", str(tmp_path / "model.json")]
    assert run(words) == 6
    estimate = document(capsys)["estimate"]
    assert {axis["grade"] for axis in estimate["axes"]} == {"good"}
    (finding,) = [each for each in estimate["findings"] if "--loaded" in each]
    assert find_run(runs, "tool").run_id in finding
    assert "2.2 ±" in finding
    convert = ["export", str(tmp_path / "model.json"), "--to", "csv", "--as-identified"]
    assert run([*convert, "-o", str(tmp_path / "model.csv")]) == 6


@pytest.mark.parametrize("more", [["empty", "again"], ["empty", "tool", "--loaded", "tool"]])
def test_equal_and_stated_payloads_give_no_finding(
    runs: Path, more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--runs", str(runs), "--json", "-o", str(tmp_path / "model.json")]
    assert run(["identify", *more, *words]) == 0
    findings = document(capsys)["estimate"]["findings"]
    assert not [each for each in findings if "--loads" in each]
