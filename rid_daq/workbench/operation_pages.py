"""Pages of all operations of the service, each with a form generated from its request."""

from __future__ import annotations

import inspect
from http import HTTPStatus
from typing import Final

from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from starlette.exceptions import HTTPException

from rid_daq.operations.catalogue import CATALOGUE, GROUPS, OF_KINDS, SECTIONS, operation
from rid_daq.operations.operation import Operation
from rid_daq.workbench.job_pages import cell_files
from rid_daq.workbench.operation_form import form_sections
from rid_daq.workbench.visit import PageRoute, Visitor

IN_A_TERMINAL: Final = "In a terminal:"
"""Beginning of a paragraph about keys, options and exit codes of a command."""

router = APIRouter(
    prefix="/cells/{cell}/operations", route_class=PageRoute, include_in_schema=False
)


@router.get("")
async def operations_page(visit: Visitor) -> HTMLResponse:
    """Show the operations, by the sections of the command line's help."""
    sections: dict[str, list[Operation]] = {title: [] for title in SECTIONS}
    for name, entry in CATALOGUE.items():
        if entry.is_job:
            sections[entry.section or GROUPS[name.split()[0]].section].append(operation(name))
    return visit.page("operations.html", sections=sections, catalogue=CATALOGUE)


@router.get("/{kind}")
async def operation_page(visit: Visitor, kind: str) -> HTMLResponse:
    """Show the form of an operation."""
    if kind not in OF_KINDS:
        raise HTTPException(HTTPStatus.NOT_FOUND, f"there is no operation {kind}")
    shown = operation(OF_KINDS[kind])
    files = await cell_files(visit)
    lists = (files.motions, files.models, files.loops, files.feedforwards, files.payloads)
    return visit.page(
        "operation.html",
        operation=shown,
        description=_description(shown),
        needs=_needs(shown),
        sections=form_sections(shown),
        known=[each for group in lists for each in group],
    )


def _description(shown: Operation) -> list[str]:
    """Return the paragraphs of an operation's description, without those for the terminal."""
    paragraphs = str(inspect.getdoc(shown.request)).split("\n\n")
    return [each for each in paragraphs if not each.startswith(IN_A_TERMINAL)]


def _needs(shown: Operation) -> str:
    """Return the requirement of the form's button, as `shell.js` knows it."""
    if shown.moves:
        return "held" if shown.is_held else "ready"
    return "lease" if shown.opens_cell else "role"
