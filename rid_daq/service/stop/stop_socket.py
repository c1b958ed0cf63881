"""`StopSocket`: WebSocket that carries STOP requests and a heartbeat, and nothing else."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Sequence
from typing import Final, cast

from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol
from websockets.typing import Subprotocol

from rid_daq.service.refusals import UnknownError
from rid_daq.service.stop.stop_answer import StopHandler
from rid_daq.web.request_secrets import SOCKET_PROTOCOL

BEAT_S: Final = 0.25
BEAT: Final = b'{"type": "beat"}'
MOST_BYTES: Final = 1024
MOST_MESSAGES: Final = 100
"""Messages per second; beyond this limit the connection is closed."""

POLICY: Final = 1008


class StopSocket(asyncio.Protocol):
    """Server side of one WebSocket. `{"stop": CELL or "*", "number": N}` is answered at once.

    Args:
        handler: Executes the stops.
        who: Name of the sender.
    """

    def __init__(self, handler: StopHandler, who: str) -> None:
        self._handler = handler
        self._who = who
        self._speaker = ServerProtocol(max_size=MOST_BYTES, select_subprotocol=_select_protocol)
        self._transport: asyncio.Transport | None = None
        self._beat: asyncio.TimerHandle | None = None
        self._refused = False
        self._closed = False
        self._second, self._messages = 0, 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport; `data_received` then gets the client's request."""
        self._transport = cast(asyncio.Transport, transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the heartbeat."""
        if self._beat is not None:
            self._beat.cancel()

    def data_received(self, data: bytes) -> None:
        """Process received bytes: the opening request and messages."""
        self._speaker.receive_data(data)
        for event in self._speaker.events_received():
            if isinstance(event, Request):
                response = self._speaker.accept(event)
                if self._speaker.eof_sent:  # the bytes after the request are not a WebSocket frame
                    break
                self._speaker.send_response(response)
            elif isinstance(event, Frame):
                self._process_frame(event)
        self._flush()
        if self._is_open and self._beat is None:
            self._send_beat()

    def eof_received(self) -> bool | None:
        """Close the connection as the WebSocket protocol requires."""
        self._speaker.receive_eof()
        self._flush()
        return None

    def shutdown(self) -> None:
        """Send the client a close frame with code 1012: the service ends."""
        if self._is_open:
            self._speaker.send_close(1012)
            self._flush()
        self._close()

    def _process_frame(self, frame: Frame) -> None:
        if frame.opcode not in (Opcode.TEXT, Opcode.BINARY, Opcode.CONT) or self._refused:
            return
        second = int(time.monotonic())
        self._messages = self._messages + 1 if second == self._second else 1
        self._second = second
        answer = self._answer(bytes(frame.data)) if frame.fin else None
        if (
            not self._is_open
        ):  # the client has closed the connection; the stop was executed all the same
            return
        if answer is None or self._messages > MOST_MESSAGES:
            self._refused = True
            self._speaker.send_close(POLICY, "send stop and number")
        else:
            self._speaker.send_text(json.dumps(answer).encode())

    def _answer(self, message: bytes) -> dict[str, object] | None:
        return answer_to_stop(self._handler, self._who, read_stop(message))

    @property
    def _is_open(self) -> bool:
        return self._speaker.state is State.OPEN

    def _send_beat(self) -> None:
        if not self._is_open:
            return
        self._speaker.send_text(BEAT)
        self._flush()
        self._beat = asyncio.get_running_loop().call_later(BEAT_S, self._send_beat)

    def _flush(self) -> None:
        assert self._transport is not None
        for data in self._speaker.data_to_send():
            if data:
                self._transport.write(data)
            else:
                self._close()
        if self._refused or self._speaker.close_expected():
            self._close()

    def _close(self) -> None:
        """Close the transport once; closing a TLS transport twice raises an error."""
        if self._transport is not None and not self._closed:
            self._closed = True
            self._transport.close()


def _select_protocol(_server: ServerProtocol, offered: Sequence[Subprotocol]) -> Subprotocol | None:
    return next((each for each in offered if each == SOCKET_PROTOCOL), None)


def read_stop(message: bytes) -> dict[str, object] | None:
    """Parse a message that requests a stop; return None for any other message."""
    try:
        found = json.loads(message)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("stop"), str) else None


def answer_to_stop(
    handler: StopHandler, who: str, message: dict[str, object] | None
) -> dict[str, object] | None:
    """Execute the stop that a WebSocket message requests and return the answer.

    Args:
        handler: Executes the stop.
        who: Name of the sender.
        message: The JSON message `{"stop": CELL or "*", "number": N}`; None for any other message.

    Returns:
        None if `message` is None.
    """
    if message is None:
        return None
    number = message.get("number")
    answer: dict[str, object] = {
        "type": "stopped",
        "number": number if isinstance(number, int | float | str) else None,
    }
    try:
        return answer | handler.stop(str(message["stop"]), who).document()
    except UnknownError as error:
        return answer | {"sent": False, "sentence": str(error)}
