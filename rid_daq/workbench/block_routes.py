"""Routes of the blocks on pages: results of runs, motions, preflights, warm-ups, histories."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Final, Literal, TypeVar

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import JSONResponse, Response

from rid_daq.blocks.block import AnyBlock, Table
from rid_daq.blocks.picture import Picture, PictureImage
from rid_daq.blocks.plot import Plot
from rid_daq.service.api.context import OfCell, OfJob, Service, Who
from rid_daq.service.api.runs import run_folder
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import require_inside
from rid_daq.service.workers.running_job import EventTail
from rid_daq.terminal.choices import NO_PAYLOAD, PAYLOAD_OF_MODEL
from rid_daq.terminal.job_events import WarmUpEvent

router = APIRouter(prefix="/blocks", include_in_schema=False)

_DRAWING_LOCK: Final = threading.Lock()

Item = TypeVar("Item")


class View:
    """Form in which a page requests blocks.

    Without `plot` and `image`, the answer is the blocks as JSON: tables as texts, plots and images
    as texts and numbers. With `plot`, the answer is the plot with that number, as a figure to zoom,
    as a CSV table or as an SVG drawing. With `image`, it is the image with that number as PNG.
    """

    def __init__(
        self,
        request: Request,
        plot: Annotated[int | None, Query(ge=0)] = None,
        image: Annotated[int | None, Query(ge=0)] = None,
        form: Annotated[Literal["csv", "svg"] | None, Query(alias="as")] = None,
    ) -> None:
        self._request, self._form = request, form
        self._plot, self._image = plot, image

    def answer(self, blocks: Iterable[AnyBlock]) -> Response:
        """Return the answer of a route.

        Raises:
            UnknownError: There is no plot or image with this number.
        """
        found = list(blocks)
        plots = [block for block in found if isinstance(block, Plot)]
        images = [each for block in found if isinstance(block, Picture) for each in block.images]
        if self._plot is not None:
            return self._draw(_numbered(plots, self._plot, "plot"))
        if self._image is not None:
            png = _numbered(images, self._image, "image").read()
            return Response(png, media_type="image/png")
        return JSONResponse([_as_document(block, plots, images) for block in found])

    def _draw(self, plot: Plot) -> Response:
        """Return a plot; matplotlib draws only one plot at a time."""
        from rid_daq.figures.figure_item import figure_item
        from rid_daq.figures.plot_tables import as_csv

        if self._form is None:
            return JSONResponse(figure_item(plot))
        saved = {"content-disposition": f'attachment; filename="{plot.name}.{self._form}"'}
        if self._form == "csv":
            return Response(as_csv(plot), media_type="text/csv", headers=saved)
        from rid_daq.report_page.drawings.plot import svg_file

        with _DRAWING_LOCK:
            return Response(svg_file(plot), media_type="image/svg+xml", headers=saved)


RequestedView = Annotated[View, Depends()]


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
    """Return texts, tables and plots that describe a motion file on a cell."""
    from rid_daq.workbench.motion_blocks import motion_blocks

    path = require_inside(file, service.folder)
    by = require_inside(model, service.folder) if model else None
    if payload is not None and payload not in (NO_PAYLOAD, PAYLOAD_OF_MODEL):
        payload = str(require_inside(payload, service.folder))
    return view.answer(motion_blocks(cell.loaded, path, by, payload, service.runs))


@router.get("/cells/{cell}/preflight")
def send_preflight(cell: OfCell, service: Service, view: RequestedView) -> Response:
    """Return the lines of the newest preflight, devices with red lines first."""
    from rid_daq.preflight.check_words import all_blocks

    found = service.readiness.preflight(cell)
    lines = () if found is None else found.lines
    red = {line.where for line in lines if line.verdict == "red"}
    return view.answer(all_blocks(sorted(lines, key=lambda line: line.where not in red)))


@router.get("/jobs/{job}/warm-up")
def send_warm_up(job: OfJob, service: Service, view: RequestedView) -> Response:
    """Return the plot of a job's warm-up until now."""
    from rid_daq.workbench.run_blocks import warm_up_plot

    events = EventTail(service.job_runner.events(job.id)).read_new()
    warmed = [event for event in events if isinstance(event, WarmUpEvent)]
    if not warmed:
        raise UnknownError(
            f"job {job.id} has measured no warm-up yet: ask again later", code="RID-JOB-UNKNOWN"
        )
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


def _as_document(block: AnyBlock, plots: list[Plot], images: list[PictureImage]) -> dict[str, Any]:
    if isinstance(block, Plot):
        number = _number_of(block, plots)
        return {"kind": "plot", "name": block.name, "caption": block.caption, "number": number}
    if isinstance(block, Picture):
        shown = [
            each.model_dump(exclude={"png"}) | {"number": _number_of(each, images)}
            for each in block.images
        ]
        return {"kind": "picture", "name": block.name, "caption": block.caption, "images": shown}
    return (block.as_texts() if isinstance(block, Table) else block).model_dump(mode="json")


def _number_of(item: object, items: Sequence[object]) -> int:
    return next(i for i, each in enumerate(items) if each is item)


def _numbered(items: Sequence[Item], number: int, what: str) -> Item:
    """Return the item with a number; raise UnknownError if there is none."""
    if number >= len(items):
        raise UnknownError(
            f"there is no {what} number {number} here: the page has {len(items)}, counted from 0",
            code="RID-RUN-FILE",
        )
    return items[number]
