"""Page of settings: files of the cell, access, and the log of user actions."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from rid_daq.service.records import Role
from rid_daq.workbench.files.cell_sources import sources_of
from rid_daq.workbench.visit import PageRoute, Visitor

router = APIRouter(prefix="/cells/{cell}", route_class=PageRoute, include_in_schema=False)


@router.get("/settings")
async def settings_page(visit: Visitor) -> HTMLResponse:
    """Show the settings."""
    sources = sources_of(visit.cell, visit.service.folder)
    return visit.page(
        "settings.html",
        sources=sources,
        problem=visit.cell.problem,
        file=visit.cell.loaded.path,
        is_administrator=visit.who.role is Role.ADMINISTRATOR,
    )
