"""`StopEntrance`: takes STOP from a request's head, before the application and without its body."""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Final

from rid_daq.service.refusals import NotKnownError, UnknownError
from rid_daq.service.stop.stop_answer import ALL, Desk
from rid_daq.service.stop.stop_line import StopLine
from rid_daq.web.access import STOP_HEADER, Access
from rid_daq.web.guard import sender_refusal
from rid_daq.web.reception import OpenConnection, Peer, Reply
from rid_daq.web.request_head import RequestHead

LINE_PATH: Final = "/api/v1/stop-line"
_STOP_PATH: Final = re.compile(r"/api/v1(?:/cells/([^/]+))?/stop")


class StopEntrance:
    """Recognises STOP and answers it at once.

    Args:
        desk: Stops.
        access: Our own names and pages: browsers of others are refused.
    """

    def __init__(self, desk: Desk, access: Access) -> None:
        self._desk = desk
        self._access = access

    def receive(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection | None:
        """Return the answer to a STOP, or its line; None for every other request."""
        if head.path == LINE_PATH and head.is_websocket:
            return self._open_line(head, peer)
        asked = _STOP_PATH.fullmatch(head.path) if head.method == "POST" else None
        return None if asked is None else self._stop(head, peer, asked[1] or ALL)

    def _stop(self, head: RequestHead, peer: Peer, target: str) -> Reply:
        refusal = sender_refusal(self._access, head.lines, local=peer.local)
        if refusal is None and not head.headers.get(STOP_HEADER):
            refusal = HTTPStatus.FORBIDDEN
        if refusal is not None:
            needed = f"a stop needs the header {STOP_HEADER}"
            return _refused(refusal, "BrowserRefused", needed, "RID-ACCESS-SENDER")
        try:
            who = self._desk.admit(head.headers, local=peer.local, address=peer.address)
            answer = self._desk.stop(target, who)
        except NotKnownError as error:
            return _refused(HTTPStatus.UNAUTHORIZED, "NotKnownError", str(error), error.refusal)
        except UnknownError as error:
            return _refused(HTTPStatus.NOT_FOUND, "UnknownError", str(error), error.refusal)
        return Reply(HTTPStatus.ACCEPTED, answer.document())

    def _open_line(self, head: RequestHead, peer: Peer) -> Reply | OpenConnection:
        refusal = sender_refusal(self._access, head.lines, local=peer.local)
        if refusal is not None:
            said = "not a page of this service"
            return _refused(refusal, "BrowserRefused", said, "RID-ACCESS-SENDER")
        try:
            who = self._desk.admit(head.headers, local=peer.local, address=peer.address)
        except NotKnownError as error:
            return _refused(HTTPStatus.UNAUTHORIZED, "NotKnownError", str(error), error.refusal)
        return OpenConnection(who, lambda: StopLine(self._desk, who))


def _refused(status: HTTPStatus, error: str, message: str, code: str) -> Reply:
    return Reply(status, {"error": error, "message": message, "code": code})
