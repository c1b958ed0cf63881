"""Connection limits and scheduler: no client can occupy all places."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rid_daq.web.connection_pool import ConnectionPool
from rid_daq.web.fair_scheduler import FairScheduler, QueueFullError


def test_a_full_pool_removes_the_oldest_of_the_largest_owner() -> None:
    pool: ConnectionPool[int] = ConnectionPool(4)
    assert [pool.add(number, "crowd") for number in range(4)] == [None] * 4
    assert pool.add(10, "anna") == 0
    assert pool.add(11, "ben") == 1
    assert sorted(pool) == [2, 3, 10, 11]
    assert pool.add(4, "crowd") == 2, "the oldest connection of the same owner is closed"


def test_an_owner_has_a_limited_number_of_connections() -> None:
    pool: ConnectionPool[int] = ConnectionPool(10, 2)
    assert [pool.add(number, "crowd") for number in range(3)] == [None, None, 0]
    assert not pool.has_place("crowd")
    assert pool.has_place("anna")


def test_the_largest_owner_gets_no_place_in_a_full_pool() -> None:
    pool: ConnectionPool[int] = ConnectionPool(4)
    for number, owner in enumerate(("a", "a", "a", "b")):
        pool.add(number, owner)
    assert pool.has_place("b")
    assert not pool.has_place("a")


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans()), max_size=60))
def test_a_pool_keeps_its_limits_for_any_sequence(steps: list[tuple[str, bool]]) -> None:
    pool: ConnectionPool[int] = ConnectionPool(5, 3)
    inside: dict[int, str] = {}
    for number, (owner, leaves) in enumerate(steps):
        inside[number] = owner
        gone = pool.add(number, owner)
        if gone is not None:
            del inside[gone]
        if leaves:
            oldest = next(iter(inside))
            assert pool.remove(oldest)
            del inside[oldest]
        assert set(pool) == set(inside)
        assert len(pool) <= 5
        assert max(map(list(inside.values()).count, "abc")) <= 3


@pytest.mark.promise("fair-turns")
def test_many_requests_of_one_owner_do_not_block_others() -> None:
    async def main() -> list[str]:
        scheduler, order = FairScheduler(at_once=3, of_one=2, waiting_of_one=10), []

        async def work(owner: str, until: asyncio.Event) -> None:
            slot = await scheduler.acquire(owner)
            order.append(owner)
            await until.wait()
            slot.release()

        until = asyncio.Event()
        async with asyncio.TaskGroup() as group:
            for _ in range(8):
                group.create_task(work("crowd", until))
            await asyncio.sleep(0)
            assert order == ["crowd", "crowd"]
            group.create_task(work("anna", until))
            await asyncio.sleep(0)
            assert order == ["crowd", "crowd", "anna"]
            group.create_task(work("ben", until))
            await asyncio.sleep(0)
            until.set()
        return order

    order = asyncio.run(main())
    assert order.count("crowd") == 8
    assert order.index("ben") <= 5, "its turn comes before most of the waiting requests"


def test_too_many_waiting_requests_are_refused_and_a_release_counts_once() -> None:
    async def main() -> None:
        scheduler = FairScheduler(at_once=2, of_one=1, waiting_of_one=1)
        first = await scheduler.acquire("a")
        second = asyncio.create_task(scheduler.acquire("a"))
        await asyncio.sleep(0)
        with pytest.raises(QueueFullError):
            await scheduler.acquire("a")
        first.release()
        first.release()
        (await second).release()
        first, waiting = await scheduler.acquire("a"), asyncio.create_task(scheduler.acquire("a"))
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        first.release()
        (await scheduler.acquire("a")).release()
        assert not scheduler._taken
        assert not scheduler._waiting

    asyncio.run(main())
