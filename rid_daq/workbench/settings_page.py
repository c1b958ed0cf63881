"""Page of settings: files of the cell, access, log of user actions, commands for a new cell."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from rid_daq.service.records import Role
from rid_daq.terminal.console import as_command
from rid_daq.workbench.files.cell_sources import sources_of
from rid_daq.workbench.visit import PageRoute, Visitor

router = APIRouter(prefix="/cells/{cell}", route_class=PageRoute, include_in_schema=False)


@router.get("/settings")
async def settings_page(visit: Visitor) -> HTMLResponse:
    """Show the settings."""
    folder = visit.service.folder
    sources = sources_of(visit.cell, folder)
    references = (each.reference for each in visit.service.cells.values())
    new = folder / "new-cell"
    return visit.page(
        "settings.html",
        sources=sources,
        problem=visit.cell.problem,
        file=visit.cell.loaded.path,
        is_administrator=visit.who.role is Role.ADMINISTRATOR,
        init=as_command("init", new, "--urdf", "ROBOT.urdf"),
        serve=as_command("serve", *references, new / "cell.yaml", "--folder", folder),
    )
