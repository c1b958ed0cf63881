"""Client programs use a served simulated cell: jobs, stops, and all kinds of ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.service_beat import SERVICE_LIMIT_S
from config.errors import LockedError, PreflightError
from rid_daq.app import run
from rid_daq.service.records import CellState, Job, JobState
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import CHECK, begin_motion, events, leased_cell, until

pytestmark = pytest.mark.slow


def test_a_command_for_a_served_cell_runs_in_the_service(
    shared: ServedProcess, tmp_path: Path
) -> None:
    here = subprocess.run(
        [sys.executable, "-m", "rid_daq", "check", "ir361"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert here.returncode == 8
    assert "RID-CELL-BUSY" in here.stderr
    finished = subprocess.run(
        [
            sys.executable,
            "-m",
            "rid_daq",
            "check",
            "ir361",
            "--seconds",
            "0.2",
            "--service",
            "local",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert "Cell ir361 is ready" in finished.stdout


def test_only_one_job_moves_a_cell_and_a_stop_ends_it(
    shared: ServedProcess, long_motion: str
) -> None:
    with leased_cell(shared, long_motion) as key:
        job = begin_motion(shared, key)
        with shared.client as client:
            assert client.cell("ir361").state is CellState.MOVING
            with raises_code(LockedError, "RID-JOB-RUNNING", "record"):
                client.run("ir361", "check", CHECK, lease=key)
            client.stop("ir361")
            over = client.follow(job)
            assert over.job.state is JobState.STOPPED
            assert over.document is not None
            assert over.document["stop"]["code"] == "STOP_BUTTON"
            assert client.cell("ir361").state is CellState.READY


def test_stop_works_while_the_service_is_suspended(
    shared: ServedProcess, long_motion: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with leased_cell(shared, long_motion) as key:
        job = begin_motion(shared, key)
        shared.process.send_signal(signal.SIGSTOP)
        try:
            stopped = run(["stop"])
        finally:
            shared.process.send_signal(signal.SIGCONT)
        captured = capsys.readouterr()
        assert stopped == 0, captured.err
        assert "all axes at rest" in captured.out
        with shared.client as client:
            over = client.follow(job)
        assert over.document is not None
        assert over.document["stop"]["code"] == "STOP_COMMAND"


@pytest.mark.parametrize(
    ("policy", "pace", "ends"), [("stop", 1.0, "stopped"), ("finish", 5.0, "done")]
)
def test_a_motion_without_its_client_ends_by_the_declared_policy(
    request: pytest.FixtureRequest, shared: ServedProcess, policy: str, pace: float, ends: str
) -> None:
    motion = request.getfixturevalue("motion" if policy == "finish" else "long_motion")
    with leased_cell(shared, motion) as key:
        job = begin_motion(shared, key, pace, on_lost_client=policy)
        with shared.client as client:
            client.ask("PUT", "/cells/ir361/lease", {"seconds": 2.0}, key)  # the last heartbeat
            over = client.follow(job)
            assert over.job.state.value == ends
            if policy == "stop":
                assert over.document is not None
                assert over.document["stop"]["code"] == "CLIENT_LOST"
                assert "lost the lease" in over.job.reason


@pytest.mark.fault(51)
@pytest.mark.promise("service-heartbeat")
@pytest.mark.parametrize("policy", ["stop", "finish"])
def test_a_motion_stops_if_the_service_hangs(
    shared: ServedProcess, long_motion: str, policy: str, measured: Callable[[str], None]
) -> None:
    with leased_cell(shared, long_motion) as key:
        job = begin_motion(shared, key, on_lost_client=policy)
        with shared.client as client:
            control = ControlBlock.of_process(client.job(job.id).pid or 0)
        assert control is not None
        shared.process.send_signal(signal.SIGSTOP)
        began_s = time.monotonic()
        try:
            until(lambda: control.task_gone)
            waited_s = time.monotonic() - began_s
            reason = control.task.stop_reason
            assert reason is not None
            assert reason.code is StopCode.SERVICE_LOST
            assert reason.value is not None
            assert SERVICE_LIMIT_S < reason.value < waited_s + 1.0
            assert control.task.ramp_s is not None, "the axes are confirmed at rest"
        finally:
            shared.process.send_signal(signal.SIGCONT)
        with shared.client as client:
            over = client.follow(job)
            assert over.job.state is JobState.STOPPED
            assert "no heartbeat" in over.job.reason
            assert "was paused" in client.cell("ir361").not_ready_because
            with pytest.raises(PreflightError) as refused:
                client.run("ir361", "record", {"motion": "motion.yaml"}, lease=key)
            assert refused.value.refusal == "RID-CELL-NOT-READY"
        measured(
            f"on_lost_client {policy}: quick stop {reason.value:.1f} s after the last heartbeat"
        )


@pytest.mark.promise("service-heartbeat")
def test_a_question_ends_if_the_service_hangs(shared: ServedProcess, motion: str) -> None:
    with leased_cell(shared, motion) as key, shared.client as client:
        body = {"kind": "jog", "request": {"practise": True}}
        job = Job.model_validate(client.ask("POST", "/cells/ir361/jobs", body, key))
        until(lambda: any(each["kind"] == "asked" for each in events(client, job)))
        pid = client.job(job.id).pid
        assert pid is not None
        shared.process.send_signal(signal.SIGSTOP)
        try:
            until(lambda: has_ended(pid))
        finally:
            shared.process.send_signal(signal.SIGCONT)
        over = client.follow(job)
        assert over.job.state.is_over
        assert "no heartbeat" in over.job.reason


def has_ended(pid: int) -> bool:
    """Return True if a worker has ended, even if the template has not yet read its exit status."""
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b") ")[2][:1] == b"Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_a_killed_worker_interrupts_its_job_and_the_cell_must_be_reset(
    shared: ServedProcess, long_motion: str
) -> None:
    with leased_cell(shared, long_motion) as key:
        job = begin_motion(shared, key)
        with shared.client as client:
            pid = client.job(job.id).pid
            assert pid is not None
            os.kill(pid, signal.SIGKILL)
            over = client.follow(job)
            assert over.job.state is JobState.INTERRUPTED
            assert "process died" in over.job.reason
            assert client.cell("ir361").state is CellState.FAULT
            client.run("ir361", "reset", {}, lease=key).require_done()
            assert client.cell("ir361").state is CellState.CLOSED
            client.run("ir361", "check", {}, lease=key).require_done()
            assert client.cell("ir361").state is CellState.READY


def test_computing_jobs_run_one_after_another(shared: ServedProcess) -> None:
    with shared.client as client:
        body = {"kind": "identify", "request": {"names": ["none"]}}
        jobs = [Job.model_validate(client.ask("POST", "/cells/ir361/jobs", body)) for _ in range(3)]
        assert [job.state for job in jobs[1:]] == [JobState.ACCEPTED, JobState.ACCEPTED]
        client.ask("POST", f"/jobs/{jobs[2].id}/cancel")
        ended = [client.follow(job).job for job in jobs]
    assert [job.state for job in ended[:2]] == [JobState.FAILED, JobState.FAILED]
    assert "no run 'none'" in ended[0].reason
    assert ended[2].reason == "cancelled by this computer before it started"


def test_two_services_do_not_share_a_folder_or_a_cell(
    shared: ServedProcess, tmp_path_factory: pytest.TempPathFactory
) -> None:
    for folder, message in [
        (shared.folder, "another service uses this folder"),
        (tmp_path_factory.mktemp("other"), "another service owns it"),
    ]:
        second = subprocess.run(
            [
                sys.executable,
                "-m",
                "rid_daq",
                "serve",
                "ir361",
                "--folder",
                str(folder),
                "--listen",
                "127.0.0.1:0",
            ],
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert second.returncode == 8
        assert message in second.stderr


def test_an_answer_to_an_unknown_question_is_refused(shared: ServedProcess, motion: str) -> None:
    with leased_cell(shared, motion) as key, shared.client as client:
        body = {"kind": "jog", "request": {}}
        job = Job.model_validate(client.ask("POST", "/cells/ir361/jobs", body, key))
        until(lambda: any(each["kind"] == "asked" for each in events(client, job)))
        with raises_code(LockedError, "RID-JOB-UNKNOWN", "99"):
            client.ask("POST", f"/jobs/{job.id}/answer", {"question": 99, "text": "x"}, key)
        client.stop("ir361")
        assert client.follow(job).job.state is JobState.STOPPED
