"""Page of a file: its text, its errors, and for a motion the 3-D view before it is saved."""

from __future__ import annotations

from dataclasses import asdict

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse

from config.formats.approved_files import sha256_of
from rid_daq.service.files.edited_file import EditedFile
from rid_daq.service.records import Role
from rid_daq.workbench.files.pose_forms import FORMS
from rid_daq.workbench.visit import PageRoute, Visitor

router = APIRouter(prefix="/cells/{cell}", route_class=PageRoute, include_in_schema=False)


@router.get("/edit/{path:path}")
async def edit_page(visit: Visitor, path: str) -> HTMLResponse:
    """Show a cell, robot or motion file for editing; a motion file need not exist yet."""
    file = await run_in_threadpool(EditedFile.find, visit.service, path)
    content = await run_in_threadpool(file.read)
    needed = Role.ADMINISTRATOR if file.cells else Role.OPERATOR
    robot = visit.cell.loaded.robot
    return visit.page(
        "edit.html",
        file=path,
        text="" if content is None else content.decode("utf-8", errors="replace"),
        file_version="" if content is None else sha256_of(content),
        is_motion=file.is_motion,
        joints=[
            {
                "name": joint.name,
                "kind": joint.type,
                "limits": (joint.limits.position_min, joint.limits.position_max),
            }
            for joint in robot.joints
        ],
        forms={
            kind: {
                "label": form.label,
                "hint": form.hint_for(robot),
                "settings": [asdict(each) for each in form.settings],
            }
            for kind, form in FORMS.items()
        },
        users=[each.name for each in file.cells],
        needed_role="" if visit.who.role.includes(needed) else needed.value,
    )
