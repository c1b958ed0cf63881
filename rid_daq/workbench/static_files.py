"""The pages' own scripts and styles; they hold nothing that somebody unknown may not see."""

from __future__ import annotations

from importlib.resources import files
from types import MappingProxyType
from typing import Final

from fastapi import APIRouter
from starlette.responses import Response

from rid_daq.service.refusals import UnknownError

router = APIRouter(include_in_schema=False)

_KINDS: Final = MappingProxyType(
    {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
)


@router.get("/static/{name}")
async def static_file(name: str) -> Response:
    """Return a script, a style or a picture of the pages."""
    for file in files("rid_daq.workbench").joinpath("static").iterdir():
        kind = _KINDS.get(name[name.rfind(".") :])
        if file.name == name and kind is not None:
            return Response(file.read_bytes(), media_type=f"{kind}; charset=utf-8")
    raise UnknownError(f"no file {name!r}")
