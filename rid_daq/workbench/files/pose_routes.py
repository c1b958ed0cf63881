"""Routes of poses that are chosen by clicks: from a motion's text to its poses, and back."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Body

from rid_daq.service.api.context import OfCell, Operator, Service
from rid_daq.service.records import Record
from rid_daq.workbench.files.pose_list import PoseList
from rid_daq.workbench.files.unsaved_motion import UnsavedMotion

router = APIRouter(prefix="/view/cells/{cell}", include_in_schema=False)


class MotionText(Record):
    """Text of a motion file."""

    text: str


@router.post("/poses")
def send_poses(
    cell: OfCell, service: Service, who: Operator, unsaved: Annotated[UnsavedMotion, Body()]
) -> PoseList | None:
    """Return the poses of a motion; null if the motion contains more than poses."""
    loaded = cell.loaded
    return PoseList.of(unsaved.motion(service, loaded), loaded.robot)


@router.post("/motion-text")
def send_motion_text(cell: OfCell, who: Operator, poses: Annotated[PoseList, Body()]) -> MotionText:
    """Return the text of a motion through poses."""
    return MotionText(text=poses.text(cell.loaded.robot))
