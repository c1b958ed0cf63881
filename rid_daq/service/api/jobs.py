"""Routes of jobs: start, list, answer, cancel."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Query
from fastapi.responses import Response
from pydantic import Field

from rid_daq.service.api.cells import LeaseKey
from rid_daq.service.api.context import OfCell, OfJob, Operator, Service, Who
from rid_daq.service.api.event_cache import event_cache
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Job, JobState, OnLostClient, Record, ShortText
from rid_daq.service.request_check import request_schemas
from rid_daq.terminal.job_events import AnyEvent

router = APIRouter(prefix="/api/v1", tags=["jobs"])


class JobCreation(Record):
    """Request for a job. Use of the bus needs the lease; a real motion also needs `cleared`."""

    kind: JobKind
    request: dict[str, object] = Field(
        default_factory=dict,
        description="Input of the job; `/api/v1/requests` returns the schema of each kind.",
    )
    cleared: bool = Field(
        default=False,
        description="True to confirm that no one is in the cell and the emergency stop is within"
        " reach.",
    )
    on_lost_client: OnLostClient = "stop"


class Answer(Record):
    """Answer to the question of a job."""

    question: int
    text: ShortText


@router.post("/cells/{cell}/jobs", status_code=HTTPStatus.CREATED)
async def begin_job(
    cell: OfCell,
    service: Service,
    who: Operator,
    wanted: Annotated[JobCreation, Body()],
    key: LeaseKey = None,
) -> Job:
    """Save a job and start it; a job that only computes may have to wait for its turn."""
    return await service.begin(
        cell,
        wanted.kind,
        wanted.request,
        who,
        lease=key,
        cleared=wanted.cleared,
        on_lost_client=wanted.on_lost_client,
    )


@router.get("/jobs")
def list_jobs(
    service: Service,
    who: Who,
    cell: str | None = None,
    state: JobState | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[Job]:
    """Return the jobs, newest first."""
    return list(service.jobs.newest(cell, state, limit))


@router.get("/jobs/{job}")
async def get_job(job: OfJob) -> Job:
    """Return a job."""
    return job


@router.get("/jobs/{job}/events", response_model=list[AnyEvent])
def get_events(
    job: OfJob,
    service: Service,
    after: Annotated[
        int, Query(ge=0, description="Number of events that the client already has.")
    ] = 0,
) -> Response:
    """Return the events of a job."""
    events = event_cache(service.job_runner.events(job.id)).after(after)
    return Response(events, media_type="application/json")


@router.post("/jobs/{job}/answer", status_code=HTTPStatus.ACCEPTED)
async def answer(
    job: OfJob,
    service: Service,
    who: Operator,
    given: Annotated[Answer, Body()],
    key: LeaseKey = None,
) -> Job:
    """Send an answer to the question of a job."""
    service.answer(job, given.question, given.text, who, key)
    return job


@router.post("/jobs/{job}/cancel", status_code=HTTPStatus.ACCEPTED)
async def cancel(job: OfJob, service: Service, who: Operator) -> Job:
    """End a job; if the job moves the robot, the motion is stopped."""
    service.cancel(job, who)
    return service.jobs.in_memory(job.id) or job


@router.get("/requests")
async def list_requests(who: Who) -> dict[str, object]:
    """Return the JSON schema of the request of every kind of job."""
    return request_schemas()
