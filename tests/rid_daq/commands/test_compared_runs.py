"""`rid-daq compare` of runs without models: conditions, verdicts, residuals, payloads."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import load_cell
from rid_daq.app import run
from rid_daq.report.result import Result
from rid_daq.report.sections.runs import AxisExtremes, RunSection
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import CELL, ROBOT
from tests.builders.json_output import document

RESULTS = Path(__file__).parents[1] / "report" / "results"

Compare = Callable[..., dict[str, Any]]


def axis(torque_nm: float, error_rad: float | None) -> AxisExtremes:
    return AxisExtremes(
        joint="axis1",
        unit="rad",
        torque_unit="N m",
        position_min=-1.0,
        position_max=1.0,
        max_velocity=1.0,
        max_torque=torque_nm,
        max_torque_percent=10.0,
        max_following_error=error_rad,
    )


def recorded(
    root: Path, label: str, cell: str = "ir361", torque_nm: float = 50.0, error: float = 4.0
) -> RunFolder:
    """Write a run with one axis in its result and a verdict on the torque error."""
    loaded = load_cell(cell)
    folder = RunFolder.create(root, label, facts={"robot": loaded.robot.name, "cell": cell})
    for name in (CELL, ROBOT):
        folder.write(name, loaded.files[name])
    folder.finish(RunStatus.COMPLETE, {"rows": 100})
    section = RunSection(
        role="recording",
        sentence="",
        stop=None,
        rows=100,
        invalid_rows=0,
        duration_s=0.4,
        axes=(axis(torque_nm, 0.004),),
        bad_rows=(),
    )
    check = VerdictCheck.of("relative torque error, axis1", error, "≤", 5.0, "%")
    verdict = VerdictSection.of([check], f"Error {error:g} %", "")
    result = Result.new(label, loaded.robot.name)
    write_result(folder, result.with_sections(runs=(section,), verdict=verdict))
    return folder


@pytest.fixture
def compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Compare:
    """Return a function that compares two runs and returns the JSON document."""

    def compared(first: str, second: str, *more: str, code: int = 0) -> dict[str, Any]:
        words = ["compare", first, second, "--runs", str(tmp_path), "--json", *more]
        assert run(words) == code
        return document(capsys)

    return compared


def test_runs_without_models_are_shown_side_by_side(tmp_path: Path, compare: Compare) -> None:
    recorded(tmp_path, "monday")
    recorded(tmp_path, "friday", torque_nm=80.0, error=9.0)
    found = compare("monday", "friday")
    assert found["verdict"]["passed"] is None
    runs = found["runs"]
    conditions = {each["name"]: each for each in runs["conditions"]}
    assert not conditions["cell"]["differs"]
    assert not conditions["robot.yaml"]["differs"]
    assert conditions["verdict"]["differs"]
    (limit,) = runs["limits"]
    assert ("passed" in limit["first"], "FAILED" in limit["second"]) == (True, True)
    torque = next(each for each in runs["axes"] if each["quantity"] == "largest torque")
    assert (torque["first"], torque["second"], torque["unit"]) == (50.0, 80.0, "N m")


def test_the_text_marks_what_differs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded(tmp_path, "same")
    other = recorded(tmp_path, "same")
    first = next(each.name for each in sorted(tmp_path.iterdir()))
    assert run(["compare", first, other.run_id, "--runs", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(first in line and other.run_id in line for line in lines)  # equal labels need ids
    assert not next(line for line in lines if line.startswith("status")).endswith("differs")


def test_payloads_are_compared_in_standard_deviations(tmp_path: Path, compare: Compare) -> None:
    kept = json.loads((RESULTS / "payload_session.json").read_text(encoding="utf-8"))
    mass = kept["payload"]["parameters"][0]
    for label, change in (("before", 0.0), ("after", 10.0 * mass["std"])):
        folder = recorded(tmp_path, label)
        heavier = {**mass, "value": mass["value"] + change}
        parameters = [heavier, *kept["payload"]["parameters"][1:]]
        changed = {**kept, "payload": {**kept["payload"], "parameters": parameters}}
        write_result(folder, Result.model_validate_json(json.dumps(changed)))
    first = compare("before", "after")["runs"]["payload"][0]
    assert first["name"] == mass["name"]
    assert first["first_std"] == mass["std"]
    assert first["sigmas"] == pytest.approx(10.0 / math.sqrt(2.0))


@pytest.mark.parametrize(
    ("second", "more", "exit_code", "code"),
    [
        ("other robot", (), 2, "RID-ROBOT-OTHER"),
        ("monday", (), 2, "RID-OPTION-EXCLUSIVE"),
        ("empty", (), 2, "RID-RUN-DAMAGED"),
        ("nobody", (), 2, "RID-RUN-UNKNOWN"),
        ("friday", ("--on", "monday"), 2, "RID-OPTION-NO-EFFECT"),
    ],
)
def test_runs_that_cannot_be_compared_are_refused(
    tmp_path: Path, compare: Compare, second: str, more: tuple[str, ...], exit_code: int, code: str
) -> None:
    recorded(tmp_path, "monday")
    recorded(tmp_path, "friday")
    recorded(tmp_path, "other robot", cell="kr15")
    RunFolder.create(tmp_path, "empty")
    found = compare("monday", second, *more, code=exit_code)
    assert found["error"]["code"] == code
