"""The guided payload session on the simulated six-axis cell: unattended and resumed."""

from __future__ import annotations

import contextlib
import io
import json
import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pypdf import PdfReader

from acquisition.journal.cycles import read_journal
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING
from acquisition.session.early_stop import NewPeriods
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.warm_up import period_powers
from rid_daq.app import run
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_runs
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_watches import MassWatch, WarmUpWatch
from rid_daq.runs.run_data import RunData
from tests.builders.screens import recorded_calls, require_fitting

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def motion(six_axis_motion: Callable[[int], Path]) -> Path:
    return six_axis_motion(3)


def session(motion: Path, runs: Path, *words: str) -> list[str]:
    short = ["--warm-up", "50", "--warm-up-periods", "4", "--rehearsal", "60"]
    return [
        "payload", "kr15", "--motion", str(motion), "--runs", str(runs), "--yes", "--json",
        *short, *words,
    ]  # fmt: skip


@pytest.fixture(scope="module")
def completed_session(
    motion: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, Any], int]:
    runs = tmp_path_factory.mktemp("session") / "runs"
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        words = session(motion, runs, "--payload", "medium", "--centre-limit", "30")
        with recorded_calls() as calls:
            code = run(words)
    require_fitting(["payload", "kr15"], calls)
    return runs, json.loads(output.getvalue()), code


def test_an_unattended_session_identifies_the_payload(
    completed_session: tuple[Path, dict[str, Any], int],
) -> None:
    _, document, code = completed_session
    assert code == 0
    assert list(document["done"]) == ["rehearsal", "warm-up", "unloaded", "loaded 1"]
    mass, *centre = document["payload"]["parameters"][:4]
    assert abs(mass["value"] - 9.579) < max(0.1, 2.5 * mass["std"])
    for entry, truth in zip(centre, (0.024, 0.090, -0.202), strict=True):
        assert abs(entry["value"] - truth) < max(0.004, 2.5 * entry["std"])
    assert document["verdict"]["passed"] is True
    assert document["facts"]["empty_flange"] == "simulated"
    assert "The simulated flange was empty" in document["verdict"]["sentence"]
    assert "Warm-up: " in document["payload"]["findings"][-1]
    assert "Simulated: medium was on the flange." in document["payload"]["findings"][-2]
    report = Path(document["report"]).read_text(encoding="utf-8")
    assert "Payload session on kr15" in report
    assert Path(document["file"]).exists()


def test_a_completed_session_gives_a_certificate(
    completed_session: tuple[Path, dict[str, Any], int], tmp_path: Path
) -> None:
    runs, document, _ = completed_session
    out = tmp_path / "certificate.pdf"
    words = ["payload", "certificate", document["session"], "-o", str(out)]
    with recorded_calls() as calls:
        assert run([*words, "--runs", str(runs)]) == 0
    require_fitting(["payload", "certificate"], calls)
    printed = " ".join(page.extract_text() for page in PdfReader(out).pages)
    text = " ".join(unicodedata.normalize("NFKC", printed).split())  # without ligatures
    mass = document["payload"]["parameters"][0]
    found = re.search(r"mass m ([\d.]+) ± ([\d.]+) kg", text)
    assert found is not None
    assert abs(float(found[1]) - mass["value"]) <= 0.1 * mass["std"]
    assert float(found[2]) == pytest.approx(2.0 * mass["std"], rel=0.05)
    assert "Simulated: medium was on the flange." in text
    for step, run_id in document["done"].items():
        assert f"{step}{run_id}".replace(" ", "") in text.replace(
            " ", ""
        )  # the text is wrapped in its table cell


def periods_of(run: Path, begun: int, periods: int) -> NewPeriods:
    """Return the periods `begun` to `periods` - 1 of a run, as a session's watch gets them."""
    recording = read_journal(run / RECORDING).recording()
    samples = recording.samples_per_period
    assert samples is not None
    first = int(recording.sample_index[recording.phase == Phase.MAIN][0])
    rows = (recording.sample_index >= first + begun * samples) & (
        recording.sample_index < first + periods * samples
    )
    part = recording.part(slice(*np.flatnonzero(rows)[[0, -1]] + [0, 1]))
    return NewPeriods(part, run, first + begun * samples, periods)


def test_the_mass_shown_during_the_motion_equals_the_reported_one(
    completed_session: tuple[Path, dict[str, Any], int],
) -> None:
    runs, document, _ = completed_session
    payload_request = PayloadRequest()
    unloaded = RunData.load(RunFolder.open(runs / document["done"]["unloaded"]))
    before = payload_runs([unloaded], [False], payload_request)
    assert isinstance(before, PeriodicRuns)
    watch = MassWatch(unloaded.robot, before, payload_request, None)
    assert not watch.add_periods(periods_of(runs / document["done"]["loaded 1"], 0, 3))
    mass = document["payload"]["parameters"][0]["value"]
    match = re.match(r"3 periods: ([\d.]+) \u00b1 ", watch.line())
    assert match is not None
    assert float(match[1]) == pytest.approx(
        mass, abs=5e-3
    )  # the value is rounded according to its interval


def test_a_warm_up_ends_once_no_friction_changes_by_more_than_the_limit(
    completed_session: tuple[Path, dict[str, Any], int],
) -> None:
    runs, document, _ = completed_session
    run = runs / document["done"]["warm-up"]
    strict = WarmUpWatch(1e-3)
    assert not strict.add_periods(periods_of(run, 0, 3))
    assert strict.line() == "warming up"
    assert not strict.add_periods(periods_of(run, 3, 4))
    # Motors with a time constant of 60 s warm up for 19 s: friction falls by some % per period.
    assert strict.drift_percent is not None
    assert 0.1 < strict.drift_percent < 10.0
    assert strict.line().startswith(f"friction of {strict.worst} changes by ")
    assert WarmUpWatch(1.01 * strict.drift_percent).add_periods(periods_of(run, 0, 4))
    assert not WarmUpWatch(0.99 * strict.drift_percent).add_periods(periods_of(run, 0, 4))


def test_an_interrupted_session_continues_with_its_next_step(
    completed_session: tuple[Path, dict[str, Any], int],
    motion: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    runs, document, _ = completed_session
    state_file = runs / document["session"] / "session.json"
    state = json.loads(state_file.read_text(encoding="utf-8"))
    del state["done"]["loaded 1"]
    RunFolder.open(state_file.parent).write("session.json", json.dumps(state).encode())
    words = ["--resume", document["session"], "--payload", "medium", "--warm-up", "0"]
    capsys.readouterr()
    assert run(session(motion, runs, *words, "--centre-limit", "30")) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["session"] == document["session"]
    assert again["done"]["unloaded"] == document["done"]["unloaded"]
    assert again["done"]["loaded 1"] != document["done"]["loaded 1"]
    mass = again["payload"]["parameters"][0]
    assert abs(mass["value"] - 9.579) < max(0.1, 2.5 * mass["std"])
    # All steps are done: the payload is identified again with other limits, without motion.
    assert run(session(motion, runs, *words, "--mass-limit", "0.1")) == 1


def test_an_option_with_its_default_value_counts_as_given(
    motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests: list[PayloadSessionRequest] = []
    monkeypatch.setattr(
        "rid_daq.command_line.operation_command.perform",
        lambda _operation, request, _console: requests.append(request),
    )
    words = ["--resume", "latest", "--mass-limit", "5", "--repeats", "1"]
    assert run(session(motion, tmp_path, *words)) == 0
    (request,) = requests
    assert {"limits", "repeats"} <= request.model_fields_set
    assert request.limits.model_fields_set == {"mass_percent"}


def test_a_session_that_cannot_be_resumed_is_refused(
    completed_session: tuple[Path, dict[str, Any], int],
    motion: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    runs, document, _ = completed_session
    other = document["done"]["unloaded"]
    assert run(session(motion, runs, "--resume", other)) == 2
    assert "RID-SESSION-STATE" in capsys.readouterr().err


def test_falling_friction_is_not_settled(tmp_path: Path) -> None:
    samples, periods = 200, 8
    time_s = np.arange(samples * periods, dtype=np.float64) * 0.01
    angle = 2.0 * np.pi * time_s / 2.0
    position = np.sin(angle)[:, np.newaxis]
    speed = np.pi * np.cos(angle)

    def recording_with_falling_friction(per_period: float) -> Recording:
        friction = 10.0 * (1.0 - per_period) ** (time_s / 2.0)
        return Recording(
            joint_names=("axis1",),
            time_s=time_s,
            position=position,
            torque_nm=(friction * np.sign(speed) + 50.0 * position[:, 0])[:, np.newaxis],
            valid=np.ones(len(time_s), dtype=np.bool_),
            phase=np.full(len(time_s), Phase.MAIN, dtype=np.uint8),
            sample_index=np.arange(len(time_s)),
            source="cell",
            sample_period_s=0.01,
            samples_per_period=samples,
        )

    powers = period_powers(recording_with_falling_friction(0.05))
    # Over a period the work of gravity is zero. Friction times |speed| remains (mean |speed|: 2).
    assert powers[0, 0] == pytest.approx(20.0, rel=0.05)
    ratios = powers[1:, 0] / powers[:-1, 0]
    assert ratios == pytest.approx(np.full(periods - 1, 0.95), abs=0.01)
    watch = WarmUpWatch(1.0)
    assert not watch.settled
    assert watch.line() == "warming up"
