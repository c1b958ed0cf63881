"""Requests that their client has given up do not occupy places of the queue."""

from __future__ import annotations

import asyncio
from pathlib import Path

from rid_daq.web.fair_scheduler import OF_ONE, WAITING_OF_ONE
from tests.rid_daq.web.test_asgi_server import ADDRESS, GET, LONG, run, start_server


def test_requests_that_their_client_has_given_up_do_not_fill_the_queue(tmp_path: Path) -> None:
    """A page that requests again and again what is late must not be refused with 429."""

    async def main() -> None:
        place = await start_server(tmp_path, LONG)
        scheduler = place.server._scheduler
        slots = [await scheduler.acquire(ADDRESS) for _ in range(OF_ONE)]
        for _ in range(2 * WAITING_OF_ONE):
            _, writer = await place.open()
            writer.write(GET)
            while not scheduler._waiting.get(ADDRESS):
                await asyncio.sleep(0.01)
            writer.close()
            while scheduler._waiting.get(ADDRESS):
                await asyncio.sleep(0.01)
        last = asyncio.create_task(place.ask(GET))
        while not scheduler._waiting.get(ADDRESS):
            await asyncio.sleep(0.01)
        for slot in slots:
            slot.release()
        assert (await last)[0] == 200
        await place.end()

    run(main())
