"""Messages that a feed sends to fast and slow viewers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from hypothesis import given
from hypothesis import strategies as st

from rid_daq.web.feed import MOST_EVENTS, Feed


async def next_messages(view: AsyncIterator[bytes], count: int) -> list[bytes]:
    return [await anext(view) for _ in range(count)]


def test_a_slow_viewer_misses_pictures_but_no_event() -> None:
    async def main() -> None:
        feed = Feed()
        feed.publish_picture(b"before")
        fast, slow = feed.view(), feed.view()
        assert await next_messages(fast, 1) == await next_messages(slow, 1) == [b"before"]
        for number in range(100):
            feed.publish_picture(b"picture %d" % number)
            if number % 10 == 0:
                feed.publish_event(b"event %d" % number)
                assert await next_messages(fast, 2) == [
                    b"event %d" % number,
                    b"picture %d" % number,
                ]
            else:
                assert await next_messages(fast, 1) == [b"picture %d" % number]
        feed.end()
        assert [each async for each in fast] == []
        events = [b"event %d" % number for number in range(0, 100, 10)]
        assert [each async for each in slow] == [*events, b"picture 99"]
        assert feed.viewers == 0

    asyncio.run(main())


def test_only_a_viewer_that_would_miss_an_event_is_disconnected() -> None:
    async def main() -> None:
        feed = Feed()
        hanging, going = feed.view(), feed.view()
        feed.publish_picture(b"now")
        assert await next_messages(hanging, 1) == await next_messages(going, 1) == [b"now"]
        for number in range(MOST_EVENTS + 1):
            feed.publish_event(b"%d" % number)
            assert await next_messages(going, 1) == [b"%d" % number]
        assert [each async for each in hanging] == []
        assert feed.viewers == 1
        feed.end()
        assert [each async for each in going] == []

    asyncio.run(main())


def test_a_viewer_after_the_end_gets_the_last_picture_and_the_end() -> None:
    async def main() -> None:
        feed = Feed()
        feed.publish_picture(b"last")
        feed.end()
        assert [each async for each in feed.view()] == [b"last"]

    asyncio.run(main())


@given(st.lists(st.sampled_from(["show", "tell", "take"]), max_size=60))
def test_events_arrive_once_in_order_and_pictures_never_go_back(steps: list[str]) -> None:
    async def main() -> None:
        feed = Feed()
        feed.publish_picture(b"p 0")
        view = feed.view()
        last_event, last_number, ready = await next_messages(view, 1), 0, 0
        for number, step in enumerate(steps, 1):
            if step == "show":
                feed.publish_picture(b"p %d" % number)
            elif step == "tell":
                feed.publish_event(b"e %d" % last_number)
                last_number += 1
            elif any(each != "take" for each in steps[ready : number - 1]):
                last_event += await next_messages(view, 1)
                ready = number
        feed.end()
        last_event += [each async for each in view]
        events = [int(each[2:]) for each in last_event if each.startswith(b"e")]
        pictures = [int(each[2:]) for each in last_event if each.startswith(b"p")]
        assert events == list(range(last_number))
        assert pictures == sorted(set(pictures))

    asyncio.run(main())


def test_a_slow_viewer_gets_the_newest_picture_of_each_subject() -> None:
    async def main() -> None:
        feed = Feed()
        feed.publish_picture(b"left 0", "left")
        slow = feed.view(first=[b"hello"])
        assert await next_messages(slow, 2) == [b"hello", b"left 0"]
        for number in range(1, 9):
            feed.publish_picture(b"left %d" % number, "left")
            feed.publish_picture(b"right %d" % number, "right")
        assert await next_messages(slow, 2) == [b"left 8", b"right 8"]
        feed.forget_picture("left")
        assert await next_messages(feed.view(), 1) == [b"right 8"]

    asyncio.run(main())


def test_a_feed_stores_at_most_the_given_number_of_events() -> None:
    async def main() -> None:
        feed = Feed(most_events=3)
        view = feed.view(first=[b"hello"])
        assert await next_messages(view, 1) == [b"hello"]
        for number in range(4):
            feed.publish_event(b"%d" % number)
        assert [each async for each in view] == []

    asyncio.run(main())
