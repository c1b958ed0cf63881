"""Events of a job: old lines are not read again, and files are read outside the event loop."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from rid_daq.service.api import jobs
from rid_daq.service.api.event_cache import EventCache, event_cache
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Job, JobState, Role
from rid_daq.service.service import CellService
from rid_daq.terminal.job_events import EVENT, MessageEvent
from tests.rid_daq.service.test_api import Api


@pytest.fixture
def job(service: CellService) -> Job:
    """Return a stored job without events."""
    job = Job(
        id="j1",
        cell="ir361",
        kind=JobKind("check"),
        state=JobState.DONE,
        owner="a test",
        request={},
        created_s=time.time(),
    )
    service.jobs.add(job)
    return job


def write_events(events: Path, *texts: str) -> None:
    with events.open("ab") as file:
        file.writelines(
            EVENT.dump_json(MessageEvent(at_s=1.0, text=text)) + b"\n" for text in texts
        )


def event_texts(service: CellService, after: int) -> list[str]:
    path = f"/api/v1/jobs/j1/events?after={after}"
    return [each["text"] for each in Api(service).ask(Role.VIEWER, "GET", path).json()]


def test_a_viewer_gets_only_new_events_and_old_lines_are_not_read_again(
    service: CellService, job: Job
) -> None:
    events = service.job_runner.events(job.id)
    assert event_texts(service, 0) == []
    write_events(events, "one", "two")
    assert event_texts(service, 0) == ["one", "two"]
    content = events.read_bytes()
    events.write_bytes(b"?" * (len(content) - 1) + b"\n")  # a second read would find no events
    write_events(events, "three")
    assert event_texts(service, 0) == ["one", "two", "three"]
    assert event_texts(service, 2) == ["three"]
    assert event_texts(service, 3) == event_texts(service, 4) == []


def test_a_damaged_line_is_not_counted_as_an_event(tmp_path: Path) -> None:
    events = tmp_path / "j1.jsonl"
    write_events(events, "one")
    with events.open("ab") as file:
        file.write(b'{"kind": "said", "te\n')
    write_events(events, "two")
    assert b'"two"' in EventCache(events).after(1)
    assert EventCache(events).after(2) == b"[]"


def test_event_files_are_read_outside_the_event_loop(
    service: CellService, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_outside_loop(events: Path) -> EventCache:
        with pytest.raises(RuntimeError, match="no running event loop"):
            asyncio.get_running_loop()
        return event_cache(events)

    write_events(service.job_runner.events(job.id), "one")
    monkeypatch.setattr(jobs, "event_cache", read_outside_loop)
    assert event_texts(service, 0) == ["one"]
