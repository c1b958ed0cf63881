"""Routes of runs."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Query
from fastapi.responses import FileResponse, Response
from pydantic import Field

from acquisition.runs.catalogue import find_run_below
from acquisition.runs.folder import RunFolder
from acquisition.runs.run_id import RUN_ID
from config.errors import ConfigError, RecordingError
from rid_daq.service.api.context import Service, Who
from rid_daq.service.api.run_groups import RunGroup, group_runs
from rid_daq.service.api.run_index import REPORT, RunEntry, entry_of, run_index
from rid_daq.service.records import Record
from rid_daq.service.refusals import UnknownError
from rid_daq.service.service import CellService

router = APIRouter(prefix="/api/v1", tags=["runs"])

RESULT: Final = "result.json"
REPORT_HEADERS: Final = {
    "content-security-policy": "sandbox allow-scripts allow-downloads; default-src 'none';"
    " script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:;"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-opener-policy": "unsafe-none",
}
"""Headers of a report. A report contains scripts and may be copied from another computer. Browsers
therefore run it in a sandbox: without an origin, without our cookies and without network access.
Browsers do not show a sandboxed page that also sets an opener policy.
"""


class RunFilter(Record):
    """Conditions on listed runs.

    Attributes:
        search: Part of the id, label, or name of robot or cell.
        status, kind, verdict: Words of the run's summary; empty for all runs.
        cell: Name of a cell; empty for all runs. Runs without a cell, such as imported ones, are
            included if they have the cell's robot, or if their robot is unknown too.
    """

    search: Annotated[str, Field(max_length=100)] = ""
    status: str = ""
    kind: str = ""
    verdict: str = ""
    cell: str = ""

    def select(self, service: CellService) -> Iterator[RunEntry]:
        """Yield the runs of a service that fulfil the conditions, newest first."""
        words = self.search.lower()
        served = service.cells.get(self.cell)
        robot = None if served is None else served.loaded.robot.name
        for run in run_index(service.runs).newest_first():
            if (
                words in f"{run.id} {run.label} {run.robot} {run.cell}".lower()
                and self.status in ("", run.status)
                and self.kind in ("", run.kind)
                and self.verdict in ("", run.verdict)
                and (self.cell in ("", run.cell) or (not run.cell and run.robot in ("", robot)))
            ):
                yield run


class RunPage(Record):
    """A part of the list of run groups.

    Attributes:
        groups: The groups, newest first.
        total: Number of groups in the complete list.
        kinds: Kinds of all runs of the cell.
    """

    groups: tuple[RunGroup, ...]
    total: int
    kinds: tuple[str, ...]


@router.get("/runs")
def list_all_runs(
    service: Service,
    who: Who,
    wanted: Annotated[RunFilter, Depends()],
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> list[RunEntry]:
    """Return the runs, newest first."""
    return list(itertools.islice(wanted.select(service), limit))


@router.get("/run-groups")
def list_run_groups(
    service: Service,
    who: Who,
    wanted: Annotated[RunFilter, Depends()],
    offset: Annotated[int, Query(ge=0)] = 0,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> RunPage:
    """Return runs that belong together as groups; a group is listed if one of its runs fits."""
    of_cell = list(RunFilter(cell=wanted.cell).select(service))
    fitting = {run.id for run in wanted.select(service)}
    groups = [
        group
        for group in group_runs(of_cell)
        if not fitting.isdisjoint((group.head.id, *(part.id for part in group.parts)))
    ]
    return RunPage(
        groups=tuple(groups[offset : offset + limit]),
        total=len(groups),
        kinds=tuple(sorted({run.kind for run in of_cell} - {""})),
    )


@router.get("/runs/{run}")
def get_run(run: str, service: Service, who: Who) -> RunEntry:
    """Return a run."""
    folder = run_folder(service, run)
    return entry_of(folder, folder.manifest())


@router.get("/runs/{run}/manifest")
def get_manifest(run: str, service: Service, who: Who) -> dict[str, object]:
    """Return the manifest of a run."""
    return run_folder(service, run).manifest().model_dump(mode="json")


@router.get("/runs/{run}/report", response_class=FileResponse)
def get_report(run: str, service: Service, who: Who) -> Response:
    """Return a run's report, a self-contained page."""
    report = _file(run_folder(service, run), REPORT, "text/html; charset=utf-8")
    report.headers.update(REPORT_HEADERS)
    return report


@router.get("/runs/{run}/result", response_class=FileResponse)
def get_result(run: str, service: Service, who: Who) -> Response:
    """Return a run's result."""
    return _file(run_folder(service, run), RESULT, "application/json")


@router.get("/runs/{run}/files/{name}", response_class=FileResponse)
def get_run_file(run: str, name: str, service: Service, who: Who) -> Response:
    """Return a file of a run as a download."""
    folder = run_folder(service, run)
    if name not in folder.manifest().files and name not in (REPORT, RESULT):
        raise UnknownError(f"run {folder.run_id} has no file {name!r}", code="RID-RUN-FILE")
    return _file(folder, name, "application/octet-stream", saved=True)


def run_folder(service: CellService, run: str) -> RunFolder:
    """Return the folder of a run of the service, by id, label or `latest`.

    Raises:
        UnknownError: There is no such run, or several runs have ids that begin like this.
        RecordingError: The manifest of the run cannot be read.
    """
    folder = RunFolder(service.runs.resolve() / run, run)
    if RUN_ID.fullmatch(run) and not folder.path.is_symlink():  # no search through all runs
        with contextlib.suppress(RecordingError):
            if folder.manifest().run_id == run:
                return folder
    try:
        return find_run_below(service.runs, run)
    except ConfigError as error:
        raise UnknownError(str(error), code=error.refusal) from None


def _file(folder: RunFolder, name: str, kind: str, *, saved: bool = False) -> Response:
    try:
        path = folder.file(name)
    except RecordingError as error:  # the path contains a symbolic link
        raise UnknownError(str(error), code="RID-RUN-LINK") from None
    if not path.is_file():
        raise UnknownError(f"run {folder.run_id} has no {name}", code="RID-RUN-FILE")
    return FileResponse(path, media_type=kind, filename=name if saved else None)
