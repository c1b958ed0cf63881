"""The end of a service by SIGTERM or SIGKILL stops the motion; its job is not restarted."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from acquisition.runs.catalogue import list_runs
from rid_daq.service.records import JobState
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.moving import begin_motion, leased_cell, until

pytestmark = pytest.mark.slow


def test_the_end_of_the_service_stops_the_motion_and_marks_its_job(
    served: ServedProcess, motion: str
) -> None:
    with leased_cell(served, motion) as key:
        job = begin_motion(served, key)
        assert served.end() == 0
        with serving(served.folder) as again, again.client as client:
            over = client.job(job.id)
        assert over.state is JobState.INTERRUPTED
        assert over.reason == "the service ended"
        assert over.run is not None
        (_, manifest), *_ = list_runs(served.folder / "runs")
        assert manifest.status == "stopped"


def test_jobs_of_a_killed_service_are_ended_and_not_restarted(
    served: ServedProcess, motion: str
) -> None:
    with leased_cell(served, motion) as key:
        job = begin_motion(served, key)
        with served.client as client:
            pid = client.job(job.id).pid
        assert pid is not None
        assert served.end(signal.SIGKILL) == -signal.SIGKILL
        until(lambda: not Path(f"/proc/{pid}").exists())
        (folder, manifest), *_ = list_runs(served.folder / "runs")
        assert manifest.status == "stopped"
        with serving(served.folder) as again, again.client as client:
            over = client.job(job.id)
            assert client.cell("ir361").job is None
        assert over.state is JobState.INTERRUPTED
        assert over.reason.startswith("the service was killed")
        assert over.run == folder.run_id
        assert len(list_runs(served.folder / "runs")) == 1
