"""Routes of figures: of runs, of motions before they are driven, of a warm-up as it goes."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse, Response

from rid_daq.service.api.context import OfCell, OfJob, Service, Who
from rid_daq.service.api.runs import run_folder
from rid_daq.service.records import Record
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import require_inside
from rid_daq.service.running_job import EventTail
from rid_daq.terminal.job_events import WarmedUp
from rid_daq.workbench.compressed import CompressedBody
from rid_daq.workbench.static_files import require_current

router = APIRouter(prefix="/figures", include_in_schema=False)

KEPT: Final = {"cache-control": "private, max-age=31536000, immutable"}
_DRAWING: Final = threading.Lock()

As = Annotated[Literal["csv"] | None, Query(alias="as")]


class FigureName(Record):
    """A figure that can be asked for."""

    name: str
    title: str


@router.get("/script/{version}/bokeh.js")
def bokeh_library(request: Request, version: str) -> Response:
    """Return BokehJS as its package has it."""
    require_current(version, "the plot library")
    return _bokeh().answer(request, "text/javascript", KEPT)


@router.get("/runs/{run}")
def list_figures(run: str, service: Service, who: Who) -> list[FigureName]:
    """Return the figures that a run has."""
    from rid_daq.workbench.run_figures import run_drawings

    drawings = run_drawings(run_folder(service, run))
    return [FigureName(name=each.name, title=each.title) for each in drawings]


@router.get("/runs/{run}/{name}")
def run_figure(
    request: Request,
    run: str,
    name: str,
    service: Service,
    who: Who,
    dark: bool = False,
    form: As = None,
) -> Response:
    """Return a figure of a run."""
    from rid_daq.workbench.run_figures import run_drawings

    folder = run_folder(service, run)
    for drawing in run_drawings(folder):
        if drawing.name == name:
            return _answer(request, drawing.make, f"{folder.run_id}-{name}", dark, form)
    raise UnknownError(f"run {folder.run_id} has no figure {name!r}", code="RID-RUN-FILE")


@router.get("/cells/{cell}/motion")
def motion_figure(
    request: Request,
    cell: OfCell,
    service: Service,
    file: str,
    model: str | None = None,
    dark: bool = False,
    form: As = None,
) -> Response:
    """Return the picture of a motion file on a cell."""
    from rid_daq.workbench.motion_facts import motion_picture

    path = require_inside(file, service.folder)
    by = None if not model else require_inside(model, service.folder)
    return _answer(
        request, lambda: motion_picture(cell.loaded, path, by), Path(file).stem, dark, form
    )


@router.get("/cells/{cell}/motion/facts")
def motion_facts(cell: OfCell, service: Service, file: str) -> dict[str, object]:
    """Return what a person should know of a motion file."""
    from rid_daq.workbench import motion_facts as facts

    path = require_inside(file, service.folder)
    return facts.motion_facts(cell.loaded, path).model_dump(mode="json")


@router.get("/jobs/{job}/warm-up")
def warm_up(
    request: Request, job: OfJob, service: Service, dark: bool = False, form: As = None
) -> Response:
    """Return the curve of a job's warm-up as far as it has come."""
    from rid_daq.figures.warm_up_figure import warm_up_figure

    told = [
        event
        for event in EventTail(service.workshop.events(job.id)).new()
        if isinstance(event, WarmedUp)
    ]
    if not told:
        raise UnknownError(f"job {job.id} has not told of a warm-up yet", code="RID-JOB-UNKNOWN")
    power = [period for event in told for period in event.power_w]

    def make() -> Any:
        import numpy as np

        return warm_up_figure(told[0].joints, np.array(power), told[0].settled_percent)

    return _answer(request, make, f"{job.id}-warm-up", dark, form)


@router.get("/cells/{cell}/history")
def history(
    request: Request,
    cell: OfCell,
    service: Service,
    quantity: str,
    dark: bool = False,
    form: As = None,
) -> Response:
    """Return how a quantity of the cell's robot has changed from run to run."""
    from rid_daq.figures.history_figure import PastValue, history_figure
    from rid_daq.workbench.robot_history import history_of

    robot = cell.loaded.robot.name
    found = [each for each in history_of(service.runs, robot) if each.title == quantity]
    if not found:
        raise UnknownError(f"no run of {robot} tells of {quantity!r}", code="RID-RUN-FILE")
    told = found[0]
    values = [
        PastValue(
            each.run_id,
            each.label,
            datetime.fromisoformat(each.created_utc),
            each.value,
            2.0 * each.std,
        )
        for each in told.entries
    ]
    return _answer(
        request, lambda: history_figure(told.title, told.unit, values), "history", dark, form
    )


def _answer(
    request: Request, make: Callable[[], Any], name: str, dark: bool, form: str | None
) -> Response:
    """Return a figure as its item or its table; one is drawn at a time."""
    from rid_daq.figures.embedding import as_csv, as_item

    with _DRAWING:
        figure = make()
        if form == "csv":
            saved = {"content-disposition": f'attachment; filename="{name}.csv"'}
            return Response(as_csv(figure), media_type="text/csv", headers=saved)
        item = JSONResponse(as_item(figure, dark))
    return CompressedBody.of(bytes(item.body)).answer(request, "application/json")


@functools.cache
def _bokeh() -> CompressedBody:
    from rid_daq.figures.embedding import bokeh_script

    return CompressedBody.of(bokeh_script().read_bytes())
