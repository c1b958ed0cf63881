"""Computing jobs in a worker: from a client's request to the events."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter
from acquisition.journal.header import JournalHeader
from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING
from config.errors import ConfigError, RidDaqError
from config.load import load_cell
from rid_daq.blocks.block import Verdict
from rid_daq.operations.perform import perform
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import check_request, parse_request
from rid_daq.service.workers.running_job import EventTail
from rid_daq.terminal.job_events import AnyEvent, ResultEvent
from rid_daq.worker.job_console import EventFile, JobConsole
from rid_daq.worker.orders import Orders
from tests.builders.raised_codes import raises_code

ROWS = 50


def run_job(kind: JobKind, document: dict[str, Any], folder: Path) -> list[AnyEvent]:
    """Run a job in a service's folder, and return its events."""
    check_request(kind, document, folder)
    request = parse_request(kind, document, cell="ir361", runs=str(folder / "runs"), cleared=False)
    path = folder / "events.jsonl"
    with EventFile(path) as file:
        perform(kind.operation, request, JobConsole(events=file, orders=Orders(io.StringIO())))
    return list(EventTail(path).read_new())


def crashed_run(folder: Path) -> RunFolder:
    """Write a run whose program ended before it could close the run."""
    cell = load_cell("ir361")
    run = RunFolder.create(folder / "runs", "crashed")
    for name, content in cell.files.items():
        run.write(name, content)
    header = JournalHeader(
        joint_names=cell.robot.joint_names, sample_period_s=0.008, run_id=run.run_id
    )
    rows = np.zeros(ROWS, dtype=row_dtype(3))
    rows["time_s"], rows["cycle"] = 0.008 * np.arange(ROWS), np.arange(ROWS)
    with JournalWriter(run.file(RECORDING), header) as writer:
        writer.append(rows.tobytes())
    return run


def test_a_run_left_by_a_crash_is_recovered_into_a_readable_run(tmp_path: Path) -> None:
    run = crashed_run(tmp_path)
    events = run_job(JobKind("recover"), {"what": run.run_id}, tmp_path)
    (result,) = (each for each in events if isinstance(each, ResultEvent))
    (entry,) = cast(dict[str, dict[str, object]], result.document["recordings"]).values()
    assert entry["rows"] == ROWS
    assert result.document["rows_lost"] == 0
    assert [each.passed for each in result.blocks if isinstance(each, Verdict)] == [True]
    statuses = {found.run_id: manifest.status for found, manifest in list_runs(tmp_path / "runs")}
    assert statuses.pop(run.run_id) == "unfinished"
    assert list(statuses.values()) == ["recovered"]


@pytest.mark.parametrize(
    ("kind", "document", "message"),
    [
        (JobKind("recover"), {"what": "nowhere"}, "nowhere"),
        (JobKind("compare"), {"first": "monday", "second": "friday"}, "monday"),
        (JobKind("tracking"), {"run": ["after"], "against": ["before"]}, "after"),
        (JobKind("payload_certificate"), {"session": "payload"}, "payload"),
        (JobKind("payload_export"), {"payload": "x.json", "to": "kuka", "output": "o.txt"}, "x"),
        (JobKind("payload_read_back"), {"payload": "x.json", "form": "kuka", "text": "M 9"}, "x"),
    ],
)
def test_an_unknown_run_is_named(
    kind: JobKind, document: dict[str, Any], message: str, tmp_path: Path
) -> None:
    (tmp_path / "runs").mkdir()
    with pytest.raises(RidDaqError) as caught:
        run_job(kind, document, tmp_path)
    assert message in str(caught.value)
    assert caught.value.refusal


def test_a_run_outside_the_folder_is_not_recovered(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    run = crashed_run(tmp_path)
    for document in ({"what": str(run.path)}, {"what": "a", "output": "../b"}):
        with raises_code(ConfigError, "RID-PATH-OUTSIDE"):
            run_job(JobKind("recover"), document, folder)


def test_a_worker_waits_for_its_job_without_slow_imports_that_few_jobs_need() -> None:
    program = (
        "import sys; from rid_daq.operations.catalogue import operation;"
        "[operation(name).load() for name in ('record', 'identify', 'check')];"
        "print(sorted({'scipy.interpolate', 'scipy.optimize', 'matplotlib'} & set(sys.modules)))"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120.0, check=True
    )
    assert shown.stdout == "[]\n"
