"""Routes of jobs: begun, looked at, answered, cancelled."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Query
from fastapi.responses import Response
from pydantic import Field

from rid_daq.service.api.cells import LeaseKey
from rid_daq.service.api.context import OfCell, OfJob, Operator, Service, Who
from rid_daq.service.api.told_events import told_events
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Job, JobState, OnLostClient, Record, ShortText
from rid_daq.service.request_check import request_schemas
from rid_daq.terminal.job_events import AnyEvent

router = APIRouter(prefix="/api/v1", tags=["jobs"])


class JobWanted(Record):
    """A job that is asked for; a motion needs the cell's lease, and each time a clear cell."""

    kind: JobKind
    request: dict[str, object] = Field(
        default_factory=dict, description="As the schema of the kind has it: `/api/v1/requests`."
    )
    cleared: bool = Field(
        default=False, description="Nobody is in the cell, and the emergency stop is at hand."
    )
    on_lost_client: OnLostClient = "stop"


class Answer(Record):
    """The answer to a question of a job."""

    question: int
    text: ShortText


@router.post("/cells/{cell}/jobs", status_code=HTTPStatus.CREATED)
async def begin_job(
    cell: OfCell,
    service: Service,
    who: Operator,
    wanted: Annotated[JobWanted, Body()],
    key: LeaseKey = None,
) -> Job:
    """Journal a job and begin it; one that only computes may wait for its turn."""
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
    """Return the newest jobs first."""
    return list(service.jobs.newest(cell, state, limit))


@router.get("/jobs/{job}")
async def get_job(job: OfJob) -> Job:
    """Return a job."""
    return job


@router.get("/jobs/{job}/events", response_model=list[AnyEvent])
def get_events(
    job: OfJob,
    service: Service,
    after: Annotated[int, Query(ge=0, description="How many are known already.")] = 0,
) -> Response:
    """Return what a job has said."""
    told = told_events(service.workshop.events(job.id)).after(after)
    return Response(told, media_type="application/json")


@router.post("/jobs/{job}/answer", status_code=HTTPStatus.ACCEPTED)
async def answer(
    job: OfJob,
    service: Service,
    who: Operator,
    given: Annotated[Answer, Body()],
    key: LeaseKey = None,
) -> Job:
    """Answer what a job asks."""
    service.answer(job, given.question, given.text, who, key)
    return job


@router.post("/jobs/{job}/cancel", status_code=HTTPStatus.ACCEPTED)
async def cancel(job: OfJob, service: Service, who: Operator) -> Job:
    """End a job; a motion is stopped."""
    service.cancel(job, who)
    return service.jobs.kept(job.id) or job


@router.get("/requests")
async def list_requests(who: Who) -> dict[str, object]:
    """Return the JSON schema of the request of every kind of job."""
    return request_schemas()
