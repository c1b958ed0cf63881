"""Routes of the 3-D view: scene and triangles of a cell's robot, pose at rest, planned motion."""

from __future__ import annotations

import functools
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse, Response

from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import Detail, SceneDocument, encode_scene
from rid_daq.service.api.context import OfCell, Service
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import require_inside
from rid_daq.service.served_cell import ServedCell
from rid_daq.workbench.block_routes import KEPT
from rid_daq.workbench.compressed import CompressedBody
from rid_daq.workbench.view.payload_centre import payload_centre
from rid_daq.workbench.view.resting_pose import resting_pose

router = APIRouter(prefix="/view/cells/{cell}", include_in_schema=False)

MOST_SCENES = 8

WantedDetail = Annotated[Detail, Query()]


@router.get("/scene")
def send_scene(
    cell: OfCell, service: Service, detail: WantedDetail = "small", payload: str | None = None
) -> JSONResponse:
    """Return the scene of a cell's robot without its triangles.

    Args:
        detail: Level of detail of the triangles to which the scene refers.
        payload: Payload file whose centre of gravity is shown.
    """
    document, _ = _encoded_scene(cell, cell.loaded.files_hash, detail)
    if payload is not None:
        centre = payload_centre(cell.loaded.robot, require_inside(payload, service.folder))
        document = document.model_copy(update={"payload_centre": centre})
    return JSONResponse(document.model_dump(mode="json"))


@router.get("/triangles/{version}/{detail}")
def send_triangles(request: Request, cell: OfCell, version: str, detail: Detail) -> Response:
    """Return the triangles of a scene; a browser keeps them until the cell's files change.

    Raises:
        UnknownError: The cell's files have changed since the page received the scene.
    """
    if version != cell.loaded.files_hash:
        raise UnknownError(
            f"the files of cell {cell.name} have changed: reload the page", code="RID-PAGE-OUTDATED"
        )
    _, body = _encoded_scene(cell, version, detail)
    return body.answer(request, "application/octet-stream", KEPT)


@router.get("/pose")
def send_pose(cell: OfCell, service: Service) -> JSONResponse:
    """Return the newest known pose of a cell that does not move, and its source."""
    return JSONResponse(resting_pose(cell.loaded, service.readiness.preflight(cell)).document())


@router.get("/motion")
def send_motion_playback(cell: OfCell, service: Service, file: str) -> JSONResponse:
    """Return the poses of a motion file for playback, with their clearances."""
    from rid_daq.workbench.view.motion_playback import motion_playback

    path = require_inside(file, service.folder)
    return JSONResponse(motion_playback(cell.loaded, path).document())


@functools.lru_cache(maxsize=MOST_SCENES)
def _encoded_scene(
    cell: ServedCell, files_hash: str, detail: Detail
) -> tuple[SceneDocument, CompressedBody]:
    loaded = cell.loaded
    named = loaded.robot.meshes
    meshes = None if named is None else loaded.files.get(named.file)
    scene = RobotScene.of(loaded.robot, loaded.config.plate, meshes=meshes)
    address = f"/view/cells/{cell.name}/triangles/{files_hash}/{detail}"
    document, binary = encode_scene(scene, address, detail)
    return document, CompressedBody.of(binary)
