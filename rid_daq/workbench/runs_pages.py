"""Pages of runs: the list, the history, and one page per run."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse

from acquisition.runs.manifest import Manifest
from rid_daq.service.api.run_index import REPORT
from rid_daq.service.api.runs import RESULT, run_folder
from rid_daq.service.service import CellService
from rid_daq.workbench.robot_history import history_of
from rid_daq.workbench.visit import PageRoute, Visitor

router = APIRouter(prefix="/cells/{cell}/runs", route_class=PageRoute, include_in_schema=False)


@router.get("")
async def runs_page(visit: Visitor) -> HTMLResponse:
    """Show the list of runs, with search and comparison."""
    return visit.page("runs.html")


@router.get("/history")
async def history_page(
    visit: Visitor, quantity: Annotated[str, Query(max_length=200)] = ""
) -> HTMLResponse:
    """Show the estimates of the cell's robot, run by run."""
    robot = visit.cell.loaded.robot.name
    histories = await run_in_threadpool(history_of, visit.service.runs, robot)
    names = [each.title for each in histories]
    chosen = quantity if quantity in names else next(iter(names), None)
    return visit.page("history.html", robot=robot, names=names, chosen=chosen)


@router.get("/{run}")
async def run_page(visit: Visitor, run: str) -> HTMLResponse:
    """Show one run."""
    manifest, sizes, has_report = await run_in_threadpool(_files_of, visit.service, run)
    facts = manifest.facts
    has_zero = facts.get("zeroed") is True and facts.get("cell") == visit.cell.name
    return visit.page(
        "run.html", run=manifest, sizes=sizes, has_report=has_report, has_zero=has_zero
    )


def _files_of(service: CellService, run: str) -> tuple[Manifest, dict[str, int], bool]:
    """Return a run's manifest, the sizes of its files, and True if it has a report."""
    folder = run_folder(service, run)
    manifest = folder.manifest()
    extra = [name for name in (REPORT, RESULT) if folder.file(name).exists()]
    sizes = {name: entry.size_bytes for name, entry in sorted(manifest.files.items())}
    sizes |= {name: folder.file(name).stat().st_size for name in extra}
    return manifest, sizes, REPORT in extra
