"""Mutated HTTP and WebSocket frames: STOP is still answered, and no connection remains."""

from __future__ import annotations

import asyncio
import contextlib
import random

import pytest

from benchmarks.framing_streams import Streams
from rid_daq.service.records import Role
from rid_daq.service.service import CellService
from rid_daq.web.connection_groups import Limits
from tests.rid_daq.service.test_stop_path import Place, place, run

STREAMS = 300
AT_ONCE = 10
SHORT = Limits(request_s=0.3, answer_s=0.3, stream_s=0.6, message_bytes=8 << 10)


async def send(made: Place, stream: bytes, *, in_parts: bool) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", made.port)
    with contextlib.suppress(OSError, TimeoutError):
        for begin in range(0, len(stream), 500 if in_parts else len(stream) or 1):
            writer.write(stream[begin : begin + 500] if in_parts else stream)
            await writer.drain()
        async with asyncio.timeout(0.2):
            await reader.read(65536)
    writer.close()


@pytest.mark.promise("framing")
@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_frames_do_not_delay_a_stop_and_leave_no_connection(
    service: CellService, seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        made = await place(service, SHORT)
        _, secret = service.tokens.add("viewer", Role.VIEWER, person=False)
        streams = Streams(random.Random(seed), made.port, secret)
        for number in range(STREAMS // AT_ONCE):
            some = [streams.stream() for _ in range(AT_ONCE)]
            await asyncio.gather(*(send(made, each, in_parts=number % 2 == 0) for each in some))
            status, answer = await made.ask(made.head())
            assert (status, answer["sent"]) == (202, False)
        while any(groups.connections for groups in made.server._groups):
            await asyncio.sleep(0.01)
        await made.end()

    run(main())
    assert "Traceback" not in caplog.text
