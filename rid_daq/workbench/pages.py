"""`PAGES`: routers of all pages; the router for unknown addresses comes last."""

from __future__ import annotations

from typing import Final

from fastapi import APIRouter

from rid_daq.workbench import (
    block_routes,
    cell_page,
    job_pages,
    login_pages,
    operation_pages,
    runs_pages,
    settings_page,
    static_files,
)
from rid_daq.workbench.files import file_pages, pose_routes
from rid_daq.workbench.view import scene_routes

PAGES: Final[tuple[APIRouter, ...]] = (
    login_pages.router,
    static_files.router,
    block_routes.router,
    scene_routes.router,
    pose_routes.router,
    cell_page.router,
    job_pages.router,
    operation_pages.router,
    runs_pages.router,
    settings_page.router,
    file_pages.router,
    login_pages.unknown,
)
