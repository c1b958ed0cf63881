"""Pages of a cell: its state with its actions, and its live signals."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from drivers.servo.bring_up import bus_load
from rid_daq.service.signals.signal_history import KEPT_S
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


@router.get("/signals")
async def signals_page(visit: Visitor) -> HTMLResponse:
    """Show the live signals of the cell over time."""
    loaded = visit.cell.loaded
    return visit.page(
        "signals.html",
        joints=[{"name": joint.name, "kind": joint.type} for joint in loaded.robot.joints],
        has_monitor=loaded.config.monitor is not None,
        bus_load=bus_load(loaded.config),
        cycle_ms=1e3 * loaded.config.cycle_time_s,
        kept_s=KEPT_S,
    )
