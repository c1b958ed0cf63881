"""Scripts, styles and images of the pages: public, and cached by their content.

Pages refer to `/static/VERSION/NAME`, which browsers cache for a year: a change of any file changes
the version. `/static/NAME` is never cached. A module at that address re-exports its versioned
module, so that a page loads each module once.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from types import MappingProxyType
from typing import Final

from fastapi import APIRouter, Request
from starlette.responses import Response

from rid_daq.service.refusals import UnknownError
from rid_daq.session.versions import program_version
from rid_daq.web.bundled_modules import bundled_modules
from rid_daq.web.compressed import LARGEST_LEVEL, CompressedBody
from rid_daq.web.script_comments import without_comments
from rid_daq.workbench.menu import command_links

router = APIRouter(include_in_schema=False)

CACHED: Final = MappingProxyType({"cache-control": "public, max-age=31536000, immutable"})
_KINDS: Final = MappingProxyType(
    {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
)
_NO_MODULES: Final = ("stop.js", "login.js", "beat.js")


@functools.cache
def static_files() -> Mapping[str, bytes]:
    """Return the files by name, including files of other packages that pages need.

    `command_links.js` is made from the menu.

    Raises:
        ConfigError: The bundle of third-party modules is missing or damaged.
    """
    own = files("rid_daq.workbench").joinpath("static").iterdir()
    shared = (
        files("rid_daq.live").joinpath("stop.js"),
        files("rid_daq.figures").joinpath("figure.js"),
        files("rid_daq.figures").joinpath("figure.css"),
    )
    ours = {
        file.name: _content_of(file)
        for file in (*own, *shared)
        if file.name[file.name.rfind(".") :] in _KINDS
    }
    links = f"export const LINKS = {json.dumps(command_links())};\n".encode()
    return {**ours, **bundled_modules(), "command_links.js": links}


def _content_of(file: Traversable) -> bytes:
    content = file.read_bytes()
    is_script = file.name.endswith(".js")
    return without_comments(content.decode()).encode() if is_script else content


@functools.cache
def static_version() -> str:
    """Return a hash of all files, of all pages and of the version of rid-daq."""
    digest = hashlib.sha256(program_version().encode())
    templates = files("rid_daq.workbench").joinpath("templates").iterdir()
    pages = {file.name: file.read_bytes() for file in templates}
    for name, content in sorted({**static_files(), **pages}.items()):
        digest.update(name.encode() + hashlib.sha256(content).digest())
    return digest.hexdigest()[:16]


def static_address(name: str) -> str:
    """Return the address of a file for pages.

    Raises:
        UnknownError: There is no file with this name.
    """
    _content(name)
    return f"/static/{static_version()}/{name}"


def require_current(version: str, name: str) -> None:
    """Raise an error if a page requests the file of another version of the program.

    Raises:
        UnknownError: The page requests another version.
    """
    if version != static_version():
        raise UnknownError(
            f"{name}: the page is of another version of the program: reload the page",
            code="RID-PAGE-OUTDATED",
        )


@router.get("/static/{version}/{name}")
async def versioned_file(request: Request, version: str, name: str) -> Response:
    """Return a file that browsers cache."""
    require_current(version, name)
    _content(name)
    return _compress(name).answer(request, _media_type(name), CACHED)


@router.get("/static/{name}")
async def static_file(name: str) -> Response:
    """Return a file that browsers do not cache; a module re-exports its versioned module."""
    content = _content(name)
    if name.endswith(".js") and name not in _NO_MODULES:
        content = f'export * from "{static_address(name)}";\n'.encode()
    return Response(content, media_type=_media_type(name))


@functools.cache
def _compress(name: str) -> CompressedBody:
    return CompressedBody.of(static_files()[name], LARGEST_LEVEL)


def _content(name: str) -> bytes:
    content = static_files().get(name)
    if content is None:
        raise UnknownError(f"no file {name!r}", code="RID-FILE-UNKNOWN")
    return content


def _media_type(name: str) -> str:
    return f"{_KINDS[name[name.rfind('.') :]]}; charset=utf-8"
