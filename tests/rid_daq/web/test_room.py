"""Places and turns: nobody takes those of all."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rid_daq.web.room import Room
from rid_daq.web.turns import NoTurnError, Turns


def test_the_oldest_of_the_owner_with_the_most_goes() -> None:
    room: Room[int] = Room(4)
    assert [room.add(number, "crowd") for number in range(4)] == [None] * 4
    assert room.add(10, "anna") == 0
    assert room.add(11, "ben") == 1
    assert sorted(room) == [2, 3, 10, 11]
    assert room.add(4, "crowd") == 2, "its own oldest"


def test_an_owner_has_only_so_many() -> None:
    room: Room[int] = Room(10, 2)
    assert [room.add(number, "crowd") for number in range(3)] == [None, None, 0]
    assert not room.has_place("crowd")
    assert room.has_place("anna")


def test_who_would_have_the_most_takes_no_place_in_a_full_room() -> None:
    room: Room[int] = Room(4)
    for number, owner in enumerate(("a", "a", "a", "b")):
        room.add(number, owner)
    assert room.has_place("b")
    assert not room.has_place("a")


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans()), max_size=60))
def test_a_room_holds_its_bounds_whatever_comes(steps: list[tuple[str, bool]]) -> None:
    room: Room[int] = Room(5, 3)
    inside: dict[int, str] = {}
    for number, (owner, leaves) in enumerate(steps):
        inside[number] = owner
        gone = room.add(number, owner)
        if gone is not None:
            del inside[gone]
        if leaves:
            oldest = next(iter(inside))
            assert room.remove(oldest)
            del inside[oldest]
        assert set(room) == set(inside)
        assert len(room) <= 5
        assert max(map(list(inside.values()).count, "abc")) <= 3


@pytest.mark.promise("fair-turns")
def test_a_crowd_of_requests_of_one_leaves_turns_to_others() -> None:
    async def main() -> list[str]:
        turns, order = Turns(at_once=3, of_one=2, waiting_of_one=10), []

        async def work(owner: str, until: asyncio.Event) -> None:
            async with turns.of(owner):
                order.append(owner)
                await until.wait()

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
    assert order.index("ben") <= 5, "in the rotation, not behind the crowd"


def test_too_many_that_wait_are_refused_and_a_turn_ends_once() -> None:
    async def main() -> None:
        turns = Turns(at_once=2, of_one=1, waiting_of_one=1)
        first = await turns.take("a")
        second = asyncio.create_task(turns.take("a"))
        await asyncio.sleep(0)
        with pytest.raises(NoTurnError):
            await turns.take("a")
        first.give_back()
        first.give_back()
        (await second).give_back()
        first, waiting = await turns.take("a"), asyncio.create_task(turns.take("a"))
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        first.give_back()
        (await turns.take("a")).give_back()
        assert not turns._taken
        assert not turns._waiting

    asyncio.run(main())
