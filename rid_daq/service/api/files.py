"""Routes of the files in the service's folder: list, read, save with their version, check."""

from __future__ import annotations

import asyncio
import contextlib
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Final, Self
from urllib.parse import quote

from fastapi import APIRouter, Depends, Header, Request
from fastapi.responses import FileResponse, Response
from pydantic import Field

from acquisition.runs.manifest import MANIFEST
from config.errors import ConfigError, system_errors
from config.formats.approved_files import sha256_of
from config.formats.bounded_file import read_file
from config.formats.whole_file import write_new
from config.formats.yaml_tree import MAX_BYTES
from rid_daq.operations.catalogue import CATALOGUE, operation
from rid_daq.service.api.cells import LeaseKey
from rid_daq.service.api.context import Operator, Service, Who
from rid_daq.service.files.deletion import delete_file
from rid_daq.service.files.edited_file import EditedFile
from rid_daq.service.files.editors import Editor
from rid_daq.service.files.file_check import ContentCheck, check_content
from rid_daq.service.folder_files import KINDS, visible_files
from rid_daq.service.records import Identity, Record, Role, ShortText
from rid_daq.service.refusals import UnknownError
from rid_daq.service.request_check import refuse_bad_file, require_inside
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService, require_role

router = APIRouter(prefix="/api/v1/files", tags=["files"])

MOST_FILE_BYTES: Final = 16 << 20
AXIS_TEST_SUFFIX: Final = ".axes.json"
"""Ending of the axis-test files of earlier versions."""

Version = Annotated[
    str | None,
    Header(
        alias="if-match",
        max_length=100,
        description="ETag of the version that is replaced; without it, only a new file is saved.",
    ),
]


KnownVersion = Annotated[
    str,
    Header(alias="if-match", max_length=100, description="ETag of the version that is deleted."),
]


@cache
def _written_endings() -> frozenset[str]:
    """Return the endings of editable files, and of those that operations write."""
    outputs = (operation(name).outputs.values() for name in CATALOGUE)
    return KINDS.union(*(endings for each in outputs for endings in each))


class FolderFile(Record):
    """File in the service's folder that requests may name."""

    path: str
    size_bytes: int
    changed_s: float

    @classmethod
    def of(cls, path: Path, folder: Path, **more: str) -> Self:
        """Return the entry of a file."""
        status = path.stat()
        inside = str(path.relative_to(folder))
        return cls(path=inside, size_bytes=status.st_size, changed_s=status.st_mtime, **more)


class SavedFile(FolderFile):
    """File that a request has saved, with its version as in its ETag."""

    version: str


class Page(Record):
    """Page on which a file is open.

    Attributes:
        tab: Random name of the page.
        base: Version that the page has read; empty for a new file.
        has_changes: True if the page has changes that are not saved.
        is_leaving: True if the page is being closed.
        cell: Cell whose robot a motion file must name; empty for any robot.
        line, column: Place of the cursor, for the help.
    """

    tab: ShortText
    base: ShortText = ""
    has_changes: bool = False
    is_leaving: bool = False
    cell: ShortText = ""
    line: Annotated[int, Field(ge=1)] = 1
    column: Annotated[int, Field(ge=1)] = 1


class FileCheck(Record):
    """Check of a file that a client edits.

    Attributes:
        version: Version on disk, as in its ETag; empty if there is no file.
        others: Other pages on which the file is open.
        differences: Lines that differ between the file on disk ("- ") and the content ("+ "); empty
            if the page has read the version on disk, or the request has no content.
        check: Errors and help; None if the request has no content.
    """

    version: str
    others: tuple[Editor, ...]
    differences: tuple[str, ...]
    check: ContentCheck | None


@router.get("")
def list_files(service: Service, who: Who) -> list[FolderFile]:
    """Return the motions, models and other files that requests may name, newest first."""
    found = []
    for path in visible_files(service.folder):
        with contextlib.suppress(OSError):  # the file has just been removed
            found.append(FolderFile.of(path, service.folder))
    return sorted(found, key=lambda each: each.changed_s, reverse=True)


@router.get("/{path:path}", response_class=FileResponse)
def get_file(path: str, service: Service, who: Who) -> Response:
    """Return a file of the service's folder as a download, including exported files.

    The ETag of a YAML file is its version for `PUT`.
    """
    found = _find_file(service, path, _written_endings())
    if not found.is_file():
        raise UnknownError(f"no file {path!r}", code="RID-FILE-UNKNOWN")
    kind = "application/octet-stream"
    if found.suffix != ".yaml" or found.stat().st_size > MAX_BYTES:
        return FileResponse(found, media_type=kind, filename=found.name)
    with system_errors(ConfigError, f"{path}: cannot read", code="RID-FILE-READ"):
        content = read_file(found, MAX_BYTES)
    saved = f"attachment; filename*=UTF-8''{quote(found.name)}"
    headers = {"etag": f'"{sha256_of(content)}"', "content-disposition": saved}
    return Response(content, media_type=kind, headers=headers)


@router.put("/{path:path}", status_code=HTTPStatus.CREATED)
async def put_file(
    path: str,
    request: Request,
    service: Service,
    who: Operator,
    version: Version = None,
    lease: LeaseKey = None,
    incomplete: bool = False,
) -> SavedFile:
    """Save a motion, a model or another YAML or JSON file.

    With `If-Match`, a YAML file of a cell or a motion file of this version is replaced. Otherwise
    existing files are not replaced. Files of a cell need the role administrator; no other client
    may hold the cell, and no job may use its bus. `incomplete` allows a file with which a cell
    cannot be loaded, for a change of several files; nothing moves until the cell can be loaded
    again.
    """
    if version is not None:
        content = await _read_body(request, path)
        file = await asyncio.to_thread(_find_editable, service, path, who)
        with file.unused(service, lease):
            await asyncio.to_thread(
                _replace, service, file, content, version.strip('"'), incomplete
            )
        service.audit.note(who.name, "changed a file", details=path)
        return SavedFile.of(file.path, service.folder, version=sha256_of(content))
    found = _find_file(service, path)
    if found.name == MANIFEST:
        raise ConfigError(
            f"{path}: the name {MANIFEST} is reserved for runs: choose another name",
            code="RID-OUTPUT-RUN",
        )
    if found.is_relative_to(service.runs.resolve()):
        raise ConfigError(
            f"{path}: only recordings write into the runs folder: choose a path outside it",
            code="RID-OUTPUT-RUN",
        )
    if found.name.endswith(AXIS_TEST_SUFFIX):
        raise ConfigError(
            f"{path}: files with this ending are reserved for axis tests: run `axes` for an axis"
            " test, or choose another name",
            code="RID-FILE-AXIS-TEST",
        )
    with service.uploads.reserve(found, path):
        content = await _read_body(request, path)
        await asyncio.to_thread(refuse_bad_file, found, content, service.folder)
        with system_errors(ConfigError, f"{path}: cannot be saved", code="RID-FILE-WRITE"):
            found.parent.mkdir(parents=True, exist_ok=True)
        await asyncio.to_thread(write_new, found, content)
    service.audit.note(who.name, "put a file", details=path)
    return SavedFile.of(found, service.folder, version=sha256_of(content))


@router.delete("/{path:path}", status_code=HTTPStatus.NO_CONTENT)
def remove_file(path: str, service: Service, who: Operator, version: KnownVersion) -> None:
    """Delete a motion, a model or another YAML or JSON file that no cell and no run uses.

    It is deleted only in the version that `If-Match` states, as `PUT` returned it.
    """
    found = _find_file(service, path)
    delete_file(service, found, path, version.strip('"'), MOST_FILE_BYTES)
    service.audit.note(who.name, "deleted a file", details=path)


@router.post("/{path:path}")
async def check_file(
    path: str, request: Request, service: Service, who: Operator, page: Annotated[Page, Depends()]
) -> FileCheck:
    """Check the content of a YAML file of a cell or of a motion file without saving it.

    A file of a cell needs the role administrator, because its errors can show other files.
    """
    content = await _read_body(request, path)
    file = await asyncio.to_thread(_find_editable, service, path, who)
    others = service.editors.note(file.path, page.tab, who, has_changes=page.has_changes)
    if page.is_leaving:
        service.editors.forget(file.path, page.tab)
    cell = service.cell(page.cell) if page.cell else None
    return await asyncio.to_thread(_check, file, content, page, cell, others)


def _check(
    file: EditedFile,
    content: bytes,
    page: Page,
    cell: ServedCell | None,
    others: tuple[Editor, ...],
) -> FileCheck:
    found = check_content(file, content, cell, (page.line, page.column)) if content else None
    version = file.version()
    is_current = version == page.base or not content
    return FileCheck(
        version=version,
        others=others,
        differences=() if is_current else file.differences(content),
        check=found,
    )


def _find_editable(service: CellService, path: str, who: Identity) -> EditedFile:
    file = EditedFile.find(service, path)
    if file.cells:
        require_role(who, Role.ADMINISTRATOR)
    return file


def _replace(
    service: CellService, file: EditedFile, content: bytes, version: str, incomplete: bool
) -> None:
    refuse_bad_file(file.path, content, service.folder)
    found = check_content(file, content)
    problems = found.problems or (() if incomplete else found.cell_problems)
    if problems:
        first = problems[0]
        where = f"{first.file or file.path.name}:{first.line or 1}"
        raise ConfigError(f"{where}: {first.text}", code=first.code)
    file.save(content, version)


async def _read_body(request: Request, path: str) -> bytes:
    content = bytearray()
    async for part in request.stream():
        content += part
        if len(content) > MOST_FILE_BYTES:
            raise ConfigError(
                f"{path}: is larger than {MOST_FILE_BYTES >> 20} MiB", code="RID-FILE-SIZE"
            )
    return bytes(content)


def _find_file(service: CellService, path: str, kinds: frozenset[str] = KINDS) -> Path:
    found = require_inside(path, service.folder)
    if found.suffix not in kinds:
        raise ConfigError(
            f"{path}: the name of the file must end in one of {', '.join(sorted(kinds))}",
            code="RID-FILE-ENDING",
        )
    return found
