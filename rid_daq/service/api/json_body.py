"""`JsonBody`: every JSON body is read strictly once, before any route sees it."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from config.errors import ConfigError
from config.formats.json_file import parse_json
from rid_daq.web.guard import SAFE_METHODS

FILES: str = "/api/v1/files/"


class JsonBody:
    """An application that is sent no body which JSON's readers disagree about.

    Half characters, NaN and infinity, keys that stand twice and deep nesting are refused with 400.
    Files are read as files, and STOP reads no body.

    Args:
        app: What answers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or let the application do so."""
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS or _reads_itself(scope):
            await self._app(scope, receive, send)
            return
        content = bytearray()
        last: Message = {"more_body": True}
        while last.get("more_body"):
            last = await receive()
            if last["type"] != "http.request":
                return  # the client has gone
            content += last.get("body", b"")
        try:
            if content:
                parse_json(bytes(content))
        except ConfigError as error:
            told = {"error": "ConfigError", "message": str(error), "code": "RID-REQUEST-JSON"}
            await JSONResponse(told, HTTPStatus.BAD_REQUEST)(scope, receive, send)
            return
        body = [Message]

        async def again() -> Message:
            if not body:
                return await receive()
            body.clear()
            return {"type": "http.request", "body": bytes(content), "more_body": False}

        await self._app(scope, again, send)


def _reads_itself(scope: Scope) -> bool:
    path: str = scope["path"]
    return path.startswith(FILES) or path.endswith("/stop")
