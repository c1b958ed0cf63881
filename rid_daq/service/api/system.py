"""Routes for monitoring: health, and metrics in Prometheus' text format."""

from __future__ import annotations

import resource

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, Gauge, generate_latest

from config.process.safety_clock import safety_now_s
from rid_daq.service.api.context import Service, Who
from rid_daq.service.records import CellState, JobState, Record
from rid_daq.session.versions import program_version

router = APIRouter(tags=["system"])


class Health(Record):
    """State of the service, its version, and the time since its start [s]."""

    status: str
    version: str
    up_s: float


@router.get("/api/v1/health")
async def health(service: Service) -> Health:
    """Return the state of the service; no token is needed."""
    up_s = safety_now_s() - service.began_s
    return Health(status="ok", version=program_version(), up_s=up_s)


@router.get("/metrics", response_class=Response)
async def metrics(service: Service, who: Who) -> Response:
    """Return the service's metrics."""
    registry = CollectorRegistry()

    def gauge(name: str, what: str, labels: tuple[str, ...] = ()) -> Gauge:
        return Gauge(f"rid_daq_{name}", what, labels, registry=registry)

    state = gauge(
        "cell_state",
        "1 for the present state of a cell, 0 for all other states.",
        ("cell", "state"),
    )
    ready = gauge("cell_ready", "1 if a cell is ready to move.", ("cell",))
    age = gauge("cell_preflight_age_seconds", "Age of the valid preflight [s].", ("cell",))
    leased = gauge("cell_leased", "1 if a client holds a cell.", ("cell",))
    for cell in service.cells.values():
        status = service.status(cell)
        for each in CellState:
            state.labels(cell.name, each.value).set(status.state is each)
        ready.labels(cell.name).set(status.state is CellState.READY)
        leased.labels(cell.name).set(status.lease is not None)
        if status.preflight_age_s is not None:
            age.labels(cell.name).set(status.preflight_age_s)
    jobs = gauge("jobs", "Number of jobs by state.", ("state",))
    counts = service.jobs.counts()
    for each_state in JobState:
        jobs.labels(each_state.value).set(counts.get(each_state.value, 0))
    gauge("viewers", "Number of connected viewers: pages and programs.").set(service.feed.viewers)
    gauge("stops_total", "Stops requested since the start.").set(service.stops)
    gauge("start_time_seconds", "Start time of the service, in seconds since 1970.").set(
        service.started_s
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    gauge("peak_memory_bytes", "Peak memory of the service.").set(1024 * peak)
    return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)
