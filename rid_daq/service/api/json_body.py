"""`JsonBody`: reads JSON bodies strictly, before a route receives them."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from config.errors import ConfigError
from config.formats.json_file import parse_json
from rid_daq.service.api.admission import FILES_PATH
from rid_daq.web.guard import SAFE_METHODS


class JsonBody:
    """Application that refuses JSON bodies that different parsers interpret differently.

    Lone surrogates, NaN and infinity, duplicate keys and deep nesting are refused with status 400.
    Uploaded files and STOP requests are not checked.

    Args:
        app: The application behind the check.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it to the application."""
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS or _skips_json_check(scope):
            await self._app(scope, receive, send)
            return
        content = bytearray()
        last: Message = {"more_body": True}
        while last.get("more_body"):
            last = await receive()
            if last["type"] != "http.request":
                return  # the client has closed the connection
            content += last.get("body", b"")
        try:
            if content:
                parse_json(bytes(content))
        except ConfigError as error:
            document = {"error": "ConfigError", "message": str(error), "code": "RID-REQUEST-JSON"}
            await JSONResponse(document, HTTPStatus.BAD_REQUEST)(scope, receive, send)
            return
        body = [Message]

        async def replay() -> Message:
            if not body:
                return await receive()
            body.clear()
            return {"type": "http.request", "body": bytes(content), "more_body": False}

        await self._app(scope, replay, send)


def _skips_json_check(scope: Scope) -> bool:
    path: str = scope["path"]
    return path.startswith(FILES_PATH) or path.endswith("/stop")
