"""`MessageChannel`: order and limits of the messages between service and front process."""

from __future__ import annotations

import asyncio
import socket

from rid_daq.service.front.message_channel import MessageChannel

MANY = 20_000


def test_a_message_to_a_full_channel_is_refused_and_the_others_arrive() -> None:
    came: list[object] = []

    async def send_and_read() -> int:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        near, far = MessageChannel(ours), MessageChannel(theirs)
        near.begin(lambda *_: None, lambda: None)
        accepted = sum(near.send({"number": number}) for number in range(MANY))
        far.begin(lambda document, *_: came.append(document["number"]), lambda: None)
        while len(came) < accepted:
            await asyncio.sleep(0.001)
        near.close()
        far.close()
        return accepted

    accepted = asyncio.run(send_and_read())
    assert accepted < MANY
    assert came == list(range(accepted))
