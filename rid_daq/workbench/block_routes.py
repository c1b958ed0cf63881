"""Routes of the blocks on pages: results of runs, motions, preflights, warm-ups, histories."""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import JSONResponse, Response
from pydantic import TypeAdapter

from rid_daq.blocks.block import AnyBlock, Table
from rid_daq.blocks.plot import Plot
from rid_daq.service.api.context import OfCell, OfJob, Service, Who
from rid_daq.service.api.runs import run_folder
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import require_inside
from rid_daq.service.workers.running_job import EventTail
from rid_daq.terminal.choices import NO_PAYLOAD, PAYLOAD_OF_MODEL
from rid_daq.terminal.job_events import WarmUpEvent
from rid_daq.workbench.compressed import CompressedBody
from rid_daq.workbench.static_files import require_current

router = APIRouter(prefix="/blocks", include_in_schema=False)

KEPT: Final = {"cache-control": "private, max-age=31536000, immutable"}
_DRAWING_LOCK: Final = threading.Lock()


class View:
    """Form in which a page requests blocks.

    Without `plot`, the answer is the blocks as JSON: tables as texts, plots as caption and number.
    With `plot`, the answer is the plot with that number, as a figure to zoom or as a CSV table.
    """

    def __init__(
        self,
        request: Request,
        plot: Annotated[int | None, Query(ge=0)] = None,
        dark: bool = False,
        form: Annotated[Literal["csv"] | None, Query(alias="as")] = None,
    ) -> None:
        self._request, self._plot, self._dark, self._form = request, plot, dark, form

    def answer(self, blocks: Iterable[AnyBlock]) -> Response:
        """Return the answer of a route.

        Raises:
            UnknownError: There is no plot with this number.
        """
        found = list(blocks)
        plots = [block for block in found if isinstance(block, Plot)]
        if self._plot is None:
            return JSONResponse([_as_document(block, plots) for block in found])
        if self._plot >= len(plots):
            raise UnknownError(
                f"there is no plot number {self._plot} in these blocks", code="RID-RUN-FILE"
            )
        return self._draw(plots[self._plot])

    def _draw(self, plot: Plot) -> Response:
        """Return a plot; only one plot is drawn at a time."""
        from rid_daq.figures.embedding import as_csv, as_item
        from rid_daq.figures.plot_figure import plot_figure

        with _DRAWING_LOCK:
            figure = plot_figure(plot)
            if self._form == "csv":
                saved = {"content-disposition": f'attachment; filename="{plot.name}.csv"'}
                return Response(as_csv(figure), media_type="text/csv", headers=saved)
            item = JSONResponse(as_item(figure, self._dark))
        return CompressedBody.of(bytes(item.body)).answer(self._request, "application/json")


RequestedView = Annotated[View, Depends()]


@router.get("/script/{version}/bokeh.js")
def bokeh_library(request: Request, version: str) -> Response:
    """Return the BokehJS library of the installed package."""
    require_current(version, "the plot library")
    return _bokeh().answer(request, "text/javascript", KEPT)


@router.get("/runs/{run}")
def send_run_blocks(
    run: str,
    service: Service,
    who: Who,
    view: RequestedView,
    section: Annotated[tuple[str, ...], Query()] = (),
) -> Response:
    """Return sections of a run's result (default: all sections)."""
    from rid_daq.workbench import run_blocks as shown

    return view.answer(shown.run_blocks(run_folder(service, run), section))


@router.get("/cells/{cell}/motion")
def send_motion(
    cell: OfCell,
    service: Service,
    view: RequestedView,
    file: str,
    model: str | None = None,
    payload: str | None = None,
) -> Response:
    """Return the blocks that describe a motion file on a cell."""
    from rid_daq.workbench.motion_blocks import motion_blocks

    path = require_inside(file, service.folder)
    by = require_inside(model, service.folder) if model else None
    if payload is not None and payload not in (NO_PAYLOAD, PAYLOAD_OF_MODEL):
        payload = str(require_inside(payload, service.folder))
    return view.answer(motion_blocks(cell.loaded, path, by, payload, service.runs))


@router.get("/cells/{cell}/preflight")
def send_preflight(cell: OfCell, service: Service, view: RequestedView) -> Response:
    """Return the lines of the newest preflight, devices with red lines first."""
    from rid_daq.preflight.bus_check import CheckLine
    from rid_daq.preflight.check_words import all_blocks

    found = service.readiness.preflight(cell)
    lines = TypeAdapter(tuple[CheckLine, ...]).validate_python(() if found is None else found.lines)
    red = {line.where for line in lines if line.verdict == "red"}
    return view.answer(all_blocks(sorted(lines, key=lambda line: line.where not in red)))


@router.get("/jobs/{job}/warm-up")
def send_warm_up(job: OfJob, service: Service, view: RequestedView) -> Response:
    """Return the plot of a job's warm-up until now."""
    from rid_daq.workbench.run_blocks import warm_up_plot

    events = EventTail(service.job_runner.events(job.id)).read_new()
    warmed = [event for event in events if isinstance(event, WarmUpEvent)]
    if not warmed:
        raise UnknownError(f"job {job.id} has no warm-up yet", code="RID-JOB-UNKNOWN")
    power = [period for event in warmed for period in event.power_w]
    return view.answer([warm_up_plot(warmed[0].joints, power, warmed[0].settled_percent)])


@router.get("/cells/{cell}/history")
def send_history(cell: OfCell, service: Service, view: RequestedView, quantity: str) -> Response:
    """Return the values of a quantity of the cell's robot, run by run."""
    from rid_daq.workbench.robot_history import history_of

    robot = cell.loaded.robot.name
    for each in history_of(service.runs, robot):
        if each.title == quantity:
            return view.answer(each.blocks())
    raise UnknownError(f"no run of {robot} has an estimate of {quantity!r}", code="RID-RUN-FILE")


def _as_document(block: AnyBlock, plots: list[Plot]) -> dict[str, Any]:
    if isinstance(block, Plot):
        number = next(i for i, each in enumerate(plots) if each is block)
        return {"kind": "plot", "name": block.name, "caption": block.caption, "number": number}
    return (block.as_texts() if isinstance(block, Table) else block).model_dump(mode="json")


@functools.cache
def _bokeh() -> CompressedBody:
    from rid_daq.figures.embedding import bokeh_script

    return CompressedBody.of(bokeh_script().read_bytes())
