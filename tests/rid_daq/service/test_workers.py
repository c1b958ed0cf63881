"""A served simulated cell, asked by programs: jobs, stops, and ends of all kinds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import LockedError
from rid_daq.service.records import CellState, Job, JobState
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import CHECK, begin_motion, events, taken, until

pytestmark = pytest.mark.slow


def test_a_command_is_done_by_the_service_that_has_the_cell(
    shared: ServedProcess, tmp_path: Path
) -> None:
    here = subprocess.run(
        [sys.executable, "-m", "rid_daq", "check", "ir361"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert here.returncode == 8
    assert "send this there with `--service local`" in here.stderr
    there = subprocess.run(
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
    assert there.returncode == 0, there.stderr
    assert "Cell ir361 is ready" in there.stdout


def test_one_job_moves_a_cell_at_a_time_and_the_apis_stop_ends_it(
    shared: ServedProcess, long_motion: str
) -> None:
    with taken(shared, long_motion) as key:
        job = begin_motion(shared, key)
        with shared.client as client:
            assert client.cell("ir361").state is CellState.MOVING
            with pytest.raises(LockedError, match="record is under way"):
                client.run("ir361", "check", CHECK, lease=key)
            client.stop("ir361")
            over = client.follow(job)
            assert over.job.state is JobState.STOPPED
            assert over.document is not None
            assert over.document["stop"]["code"] == "STOP_BUTTON"
            assert client.cell("ir361").state is CellState.READY


def test_a_stop_needs_no_living_server(shared: ServedProcess, long_motion: str) -> None:
    with taken(shared, long_motion) as key:
        job = begin_motion(shared, key)
        shared.process.send_signal(signal.SIGSTOP)
        try:
            stopped = subprocess.run(
                [sys.executable, "-m", "rid_daq", "stop"],
                capture_output=True,
                text=True,
                check=False,
            )
        finally:
            shared.process.send_signal(signal.SIGCONT)
        assert stopped.returncode == 0, stopped.stderr
        assert "all axes at rest" in stopped.stdout
        with shared.client as client:
            over = client.follow(job)
        assert over.document is not None
        assert over.document["stop"]["code"] == "STOP_COMMAND"


@pytest.mark.parametrize(
    ("policy", "pace", "ends"), [("stop", 1.0, "stopped"), ("finish", 5.0, "done")]
)
def test_a_client_that_is_gone_ends_a_motion_as_it_has_declared(
    request: pytest.FixtureRequest, shared: ServedProcess, policy: str, pace: float, ends: str
) -> None:
    motion = request.getfixturevalue("motion" if policy == "finish" else "long_motion")
    with taken(shared, motion) as key:
        job = begin_motion(shared, key, pace, on_lost_client=policy)
        with shared.client as client:
            client.ask("PUT", "/cells/ir361/lease", {"seconds": 2.0}, key)  # the last heartbeat
            over = client.follow(job)
            assert over.job.state.value == ends
            if policy == "stop":
                assert over.document is not None
                assert over.document["stop"]["code"] == "CLIENT_LOST"
                assert "out of reach" in over.job.reason


def test_a_killed_worker_is_an_interrupted_job_and_its_cell_must_be_reset(
    shared: ServedProcess, long_motion: str
) -> None:
    with taken(shared, long_motion) as key:
        job = begin_motion(shared, key)
        with shared.client as client:
            pid = client.job(job.id).pid
            assert pid is not None
            os.kill(pid, signal.SIGKILL)
            over = client.follow(job)
            assert over.job.state is JobState.INTERRUPTED
            assert "its process died" in over.job.reason
            assert client.cell("ir361").state is CellState.FAULT
            client.run("ir361", "reset", {}, lease=key).require_done()
            assert client.cell("ir361").state is CellState.CLOSED
            client.run("ir361", "check", {}, lease=key).require_done()
            assert client.cell("ir361").state is CellState.READY


def test_jobs_that_compute_wait_for_one_another(shared: ServedProcess) -> None:
    with shared.client as client:
        wanted = {"kind": "identify", "request": {"names": ["none"]}}
        jobs = [
            Job.model_validate(client.ask("POST", "/cells/ir361/jobs", wanted)) for _ in range(3)
        ]
        assert [job.state for job in jobs[1:]] == [JobState.ACCEPTED, JobState.ACCEPTED]
        client.ask("POST", f"/jobs/{jobs[2].id}/cancel")
        ended = [client.follow(job).job for job in jobs]
    assert [job.state for job in ended[:2]] == [JobState.FAILED, JobState.FAILED]
    assert "no run 'none'" in ended[0].reason
    assert ended[2].reason == "cancelled by this computer before it began"


def test_two_services_do_not_share_a_folder_or_a_cell(
    shared: ServedProcess, tmp_path_factory: pytest.TempPathFactory
) -> None:
    for folder, said in [
        (shared.folder, "another service works in this folder"),
        (tmp_path_factory.mktemp("other"), "another service has it"),
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
        assert said in second.stderr


def test_what_a_job_does_not_ask_is_not_answered(shared: ServedProcess, motion: str) -> None:
    with taken(shared, motion) as key, shared.client as client:
        wanted = {"kind": "jog", "request": {}}
        job = Job.model_validate(client.ask("POST", "/cells/ir361/jobs", wanted, key))
        until(lambda: any(each["kind"] == "asked" for each in events(client, job)))
        with pytest.raises(LockedError, match="does not ask question 99"):
            client.ask("POST", f"/jobs/{job.id}/answer", {"question": 99, "text": "x"}, key)
        client.stop("ir361")
        assert client.follow(job).job.state is JobState.STOPPED
