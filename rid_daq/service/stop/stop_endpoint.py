"""`StopEndpoint`: answers STOP from the request's head, before the application and its body."""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Final

from rid_daq.service.refusals import NotKnownError, UnknownError
from rid_daq.service.stop.stop_answer import ALL, StopHandler
from rid_daq.service.stop.stop_socket import StopSocket
from rid_daq.web.access import STOP_HEADER, Access
from rid_daq.web.guard import sender_refusal
from rid_daq.web.head_handler import OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead

LINE_PATH: Final = "/api/v1/stop-line"
_STOP_PATH: Final = re.compile(r"/api/v1(?:/cells/([^/]+))?/stop")


class StopEndpoint:
    """Recognises STOP requests and answers them at once.

    Args:
        handler: Executes the stops.
        access: Names and pages of this service; requests from other web pages are refused.
    """

    def __init__(self, handler: StopHandler, access: Access) -> None:
        self._handler = handler
        self._access = access

    def receive(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection | None:
        """Return the answer to a STOP request, or its WebSocket; None for any other request."""
        if head.path == LINE_PATH and head.is_websocket:
            return self._open_line(head, peer)
        match = _STOP_PATH.fullmatch(head.path) if head.method == "POST" else None
        return None if match is None else self._stop(head, peer, match[1] or ALL)

    def _stop(self, head: RequestHead, peer: Peer, target: str) -> Reply:
        refusal = sender_refusal(self._access, head.lines, local=peer.local)
        if refusal is None and not head.headers.get(STOP_HEADER):
            refusal = HTTPStatus.FORBIDDEN
        if refusal is not None:
            needed = f"a STOP request needs the header {STOP_HEADER}"
            return _refusal_reply(refusal, "BrowserRefused", needed, "RID-ACCESS-SENDER")
        try:
            who = self._handler.identify_sender(
                head.headers, local=peer.local, address=peer.address
            )
            answer = self._handler.stop(target, who)
        except NotKnownError as error:
            return _refusal_reply(
                HTTPStatus.UNAUTHORIZED, "NotKnownError", str(error), error.refusal
            )
        except UnknownError as error:
            return _refusal_reply(HTTPStatus.NOT_FOUND, "UnknownError", str(error), error.refusal)
        return Reply(HTTPStatus.ACCEPTED, answer.document())

    def _open_line(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection:
        refusal = sender_refusal(self._access, head.lines, local=peer.local)
        if refusal is not None:
            said = "this request does not come from a page of this service"
            return _refusal_reply(refusal, "BrowserRefused", said, "RID-ACCESS-SENDER")
        try:
            who = self._handler.identify_sender(
                head.headers, local=peer.local, address=peer.address
            )
        except NotKnownError as error:
            return _refusal_reply(
                HTTPStatus.UNAUTHORIZED, "NotKnownError", str(error), error.refusal
            )
        return OpenConnection(who, lambda: StopSocket(self._handler, who))


def _refusal_reply(status: HTTPStatus, error: str, message: str, code: str) -> Reply:
    return Reply(status, {"error": error, "message": message, "code": code})
