"""`FrontLink`: messages to a front process at its start."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from types import SimpleNamespace
from typing import Any, cast

import pytest

from rid_daq.service.front.front_link import FrontLink
from rid_daq.service.front.message_channel import MessageChannel
from rid_daq.service.service import CellService
from rid_daq.web.access import Access
from rid_daq.web.asgi_server import AsgiServer

SECRETS = [f"hash {number}" for number in range(1200)]


def test_a_new_front_process_receives_all_jobs_and_secrets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A front process can die during a motion; the next one must be able to stop the motion."""
    fronts: list[tuple[MessageChannel, list[dict[str, Any]]]] = []

    async def start(*_command: str, pass_fds: tuple[int, ...], **_: object) -> SimpleNamespace:
        channel, messages = MessageChannel(socket.socket(fileno=os.dup(pass_fds[0]))), []
        channel.begin(lambda document, *_: messages.append(document), lambda: None)
        fronts.append((channel, messages))
        return SimpleNamespace(returncode=0, wait=lambda: asyncio.sleep(0.0))

    async def jobs_told(number: int) -> None:
        while len(fronts) <= number or not any("jobs" in each for each in fronts[number][1]):
            await asyncio.sleep(0.001)

    async def take_over() -> None:
        service = SimpleNamespace(
            cells=["a"],
            tokens=SimpleNamespace(issued=lambda: SECRETS),
            job_runner=SimpleNamespace(),
        )
        link = FrontLink(
            cast(CellService, service), cast(AsgiServer, None), Access("127.0.0.1", 1, ""), []
        )
        running = asyncio.get_running_loop().create_task(link.run())
        await jobs_told(0)
        service.job_runner.bus_owners_changed({"a": 4711})
        fronts[0][0].close()
        await jobs_told(1)
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    monkeypatch.setattr("rid_daq.service.front.front_link._PAUSE_S", 0.0)
    asyncio.run(asyncio.wait_for(take_over(), 60.0))
    messages = fronts[1][1]
    assert [each for document in messages for each in document.get("issued", ())] == SECRETS
    assert [document["jobs"] for document in messages if "jobs" in document] == [{"a": 4711}]
