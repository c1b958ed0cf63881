"""Pages of the work on a cell: Experiment, Identify, Friction, Payload, Compensation."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse

from config.robot.friction_terms import FRICTION_TERM_WORDS
from rid_daq.service.api.context import OfCell, Service
from rid_daq.service.api.runs import run_folder
from rid_daq.service.folder_files import folder_files
from rid_daq.service.records import FilesOfCell, Role
from rid_daq.workbench.files.cell_sources import sources_of
from rid_daq.workbench.visit import PageRoute, Visit, Visitor

router = APIRouter(prefix="/cells/{cell}", route_class=PageRoute, include_in_schema=False)


@router.get("/experiment")
async def experiment_page(visit: Visitor) -> HTMLResponse:
    """Show the motions that can be recorded, with their plots.

    The usual periods are whole numbers of the cell's cycles.
    """
    cycle_s = visit.cell.loaded.config.cycle_time_s
    usual, multisine = (f"{round(each / cycle_s) * cycle_s:.9g}" for each in (10.0, 8.0))
    return visit.page(
        "experiment.html", files=await cell_files(visit), usual=usual, multisine=multisine
    )


@router.get("/identify")
async def identify_page(visit: Visitor) -> HTMLResponse:
    """Show the steps from runs to a model."""
    from rid_daq.operations.identify.export import ENDINGS

    return visit.page(
        "identify.html",
        files=await cell_files(visit),
        endings=ENDINGS,
        friction_terms=FRICTION_TERM_WORDS,
    )


@router.get("/identify/check")
def identify_check(
    cell: OfCell, service: Service, run: Annotated[list[str] | None, Query()] = None
) -> dict[str, object]:
    """Return the findings about runs that will be identified together."""
    from rid_daq.workbench.data_check import check_data

    folders = [run_folder(service, name) for name in run or ()]
    return check_data(cell.loaded, folders).model_dump(mode="json")


@router.get("/friction")
async def friction_page(visit: Visitor) -> HTMLResponse:
    """Show the measurement of friction, from constant-speed runs or paths and their reversals."""
    robot_file = await run_in_threadpool(_edited_robot, visit)
    return visit.page("friction.html", files=await cell_files(visit), robot_file=robot_file)


@router.get("/payload")
async def payload_page(visit: Visitor) -> HTMLResponse:
    """Show the guided payload session."""
    from identification.choices import LoadFormat
    from identification.payload.rating import HeaviestPayload, NegligibleErrors

    robot, plant = visit.cell.loaded.robot, visit.cell.loaded.plant
    return visit.page(
        "payload.html",
        files=await cell_files(visit),
        payloads=() if plant is None else tuple(plant.payloads),
        formats=tuple(LoadFormat),
        heaviest=HeaviestPayload.of(robot),
        negligible=NegligibleErrors.of(robot),
    )


@router.get("/payload/sessions")
def payload_sessions(cell: OfCell, service: Service) -> dict[str, object]:
    """Return the payload sessions of the cell that can be resumed, and those with a result."""
    from rid_daq.workbench.payload_sessions import sessions_of

    return asdict(sessions_of(service.runs, cell.name, service.folder))


@router.get("/compensation")
async def compensation_page(visit: Visitor) -> HTMLResponse:
    """Show velocity loops, feedforward, paths before and after, and streaming."""
    return visit.page("compensation.html", files=await cell_files(visit))


def _edited_robot(visit: Visit) -> str:
    """Return the robot file's path for editing; empty if the user cannot edit it."""
    sources = sources_of(visit.cell, visit.service.folder)
    robot = visit.cell.loaded.disk_names.get("robot.yaml")
    if robot is None or visit.who.role is not Role.ADMINISTRATOR:
        return ""
    return next((each.edit_path for each in sources if each.name == robot.resolve().name), "")


async def cell_files(visit: Visit) -> FilesOfCell:
    """Return the files in the service's folder for the cell's robot."""
    robot = visit.cell.loaded.robot.name
    return await run_in_threadpool(folder_files, visit.service, robot)
