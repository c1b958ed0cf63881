"""Routes of the 3-D view: scene and triangles of a cell's robot, pose at rest, planned motion."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import APIRouter, Body, Query, Request
from fastapi.responses import JSONResponse, Response

from acquisition.motion.motion_file import AnyMotion
from config.load import LoadedCell
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import Detail, SceneDocument, encode_scene
from rid_daq.service.api.context import OfCell, Operator, Service
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import require_inside
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.web.compressed import CompressedBody
from rid_daq.workbench.files.unsaved_motion import UnsavedMotion
from rid_daq.workbench.view.payload_centre import payload_centre
from rid_daq.workbench.view.resting_pose import resting_pose

router = APIRouter(prefix="/view/cells/{cell}", include_in_schema=False)

MOST_SCENES = 8
CACHED = {"cache-control": "private, max-age=31536000, immutable"}

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
    loaded = cell.loaded
    document, _, _ = _encode_scene(_CellScene(cell.name, loaded.files_hash, detail, loaded))
    if payload is not None:
        centre = payload_centre(loaded.robot, require_inside(payload, service.folder))
        document = document.model_copy(update={"payload_centre": centre})
    return JSONResponse(document.model_dump(mode="json"))


@router.get("/triangles/{version}/{detail}")
def send_triangles(request: Request, cell: OfCell, version: str, detail: Detail) -> Response:
    """Return the triangles of a scene; a browser keeps them, because the address names the content.

    Raises:
        UnknownError: The robot's shape has changed since the page received the scene.
    """
    loaded = cell.loaded
    _, body, present = _encode_scene(_CellScene(cell.name, loaded.files_hash, detail, loaded))
    if version != present:
        raise UnknownError(
            f"the files of cell {cell.name} have changed since the page was loaded: reload it",
            code="RID-PAGE-OUTDATED",
        )
    return body.answer(request, "application/octet-stream", CACHED)


@router.get("/pose")
def send_pose(cell: OfCell, service: Service) -> JSONResponse:
    """Return the newest known pose of a cell that does not move, and its source."""
    return JSONResponse(resting_pose(cell.loaded, service.readiness.preflight(cell)).document())


@router.get("/motion")
def send_motion_playback(cell: OfCell, service: Service, file: str) -> JSONResponse:
    """Return the poses of a motion file for playback, with approach and clearances."""
    from rid_daq.operations.cell_files import read_motion_for

    path = require_inside(file, service.folder)
    return _playback(cell, service, read_motion_for(path, cell.loaded))


@router.post("/motion")
def send_unsaved_playback(
    cell: OfCell, service: Service, who: Operator, unsaved: Annotated[UnsavedMotion, Body()]
) -> JSONResponse:
    """Return the poses of a motion that is not saved yet."""
    return _playback(cell, service, unsaved.motion(service, cell.loaded))


def _playback(cell: ServedCell, service: CellService, motion: AnyMotion) -> JSONResponse:
    from rid_daq.workbench.view.motion_playback import motion_playback

    loaded = cell.loaded
    start = resting_pose(loaded, service.readiness.preflight(cell))
    document = motion_playback(loaded, motion, start).document()
    return JSONResponse({**document, "files_hash": loaded.files_hash})


@dataclass(frozen=True)
class _CellScene:
    """A scene of a cell with the content of the cell's files; equal if the hashes are equal."""

    cell: str
    files_hash: str
    detail: Detail
    loaded: LoadedCell = field(compare=False, repr=False)


@functools.lru_cache(maxsize=MOST_SCENES)
def _encode_scene(wanted: _CellScene) -> tuple[SceneDocument, CompressedBody, str]:
    """Return the scene of a cell, its triangles, and the version of the triangles."""
    loaded = wanted.loaded
    named = loaded.robot.meshes
    meshes = None if named is None else loaded.files.get(named.file)
    scene = RobotScene.of(loaded.robot, loaded.config.plate, meshes=meshes)
    document, binary = encode_scene(scene, "", wanted.detail)
    version = hashlib.sha256(binary).hexdigest()[:16]
    address = f"/view/cells/{wanted.cell}/triangles/{version}/{wanted.detail}"
    named_files = {"geometry": address, "files_hash": wanted.files_hash}
    return document.model_copy(update=named_files), CompressedBody.of(binary), version
