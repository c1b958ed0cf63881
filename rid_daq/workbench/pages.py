"""`PAGES`: the routers of all pages, the one for unknown addresses last."""

from __future__ import annotations

from typing import Final

from fastapi import APIRouter

from rid_daq.workbench import (
    block_routes,
    cell_page,
    door_pages,
    job_pages,
    operation_pages,
    runs_pages,
    settings_page,
    static_files,
)

PAGES: Final[tuple[APIRouter, ...]] = (
    door_pages.router,
    static_files.router,
    block_routes.router,
    cell_page.router,
    job_pages.router,
    operation_pages.router,
    runs_pages.router,
    settings_page.router,
    door_pages.unknown,
)
