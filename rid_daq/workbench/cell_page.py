"""Page of a cell: its state, its actions, and obstacles to motions."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from rid_daq.workbench.visit import PageRoute, Visitor

router = APIRouter(prefix="/cells/{cell}", route_class=PageRoute, include_in_schema=False)


@router.get("")
async def cell_page(visit: Visitor) -> HTMLResponse:
    """Show the cell."""
    loaded = visit.cell.loaded
    return visit.page(
        "cell.html",
        robot=loaded.robot,
        has_plate=loaded.config.plate is not None,
        has_home=loaded.config.home is not None,
        cycle_ms=1e3 * loaded.config.cycle_time_s,
    )
