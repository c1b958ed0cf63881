"""Random packets on the simulated bus's socket: the hub continues, and so do other clients."""

from __future__ import annotations

import os
import random
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from config.errors import TransportError
from mock_hw.bus.hub_protocol import FRAME, HEADER, HubRole, PacketKind, pack

Serve = Callable[..., Any]
EXTREME = (0, 1, -1, 2**31, 2**62, 2**63 - 1, -(2**63))
CLIENTS = 120
PATIENCE = 50


def hostile_packet(chance: random.Random) -> bytes:
    """Return garbage, or a valid-looking packet with an absurd value."""
    match chance.randrange(5):
        case 0:
            return chance.randbytes(chance.randrange(1, 300))
        case 1:
            role = chance.choice([*HubRole, 7, 255])
            return pack(PacketKind.HELLO, role) + chance.randbytes(chance.randrange(9))
        case 2:
            header = HEADER.pack(
                chance.choice([*PacketKind, 99]), chance.randrange(3), 1, chance.choice(EXTREME)
            )
            return header + FRAME.pack(
                chance.choice(EXTREME), chance.choice((0x181, 0x7FF, 0x800, 2**29, 2**31)),
                chance.choice((0, 8, 9, 255)), chance.randrange(256), bytes(8),
            )  # fmt: skip
        case 3:
            return pack(PacketKind.IDLE, chance.randrange(2), 5, chance.choice(EXTREME))
        case _:
            return pack(PacketKind.SEND) + chance.randbytes(FRAME.size * chance.randrange(4))


def connect(client: socket.socket, hub: Any) -> None:
    """Connect, however long the hub needs to accept the client."""
    client.settimeout(None)
    client.connect(str(hub.path))


def join(hub: Any, role: HubRole) -> Any:
    """Join the bus as soon as there is room."""
    give_up_s = time.monotonic() + 120.0
    while True:
        try:
            return hub.join(role)
        except TransportError:
            if time.monotonic() > give_up_s:
                raise
            os.sched_yield()


@pytest.mark.parametrize("realtime", [False, True])
def test_hostile_clients_do_not_affect_others(serve: Serve, realtime: bool) -> None:
    hub = serve(realtime=realtime)
    chance = random.Random(8)
    for _ in range(CLIENTS):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
            connect(client, hub)
            if chance.random() < 0.5:
                client.send(pack(PacketKind.HELLO, chance.choice([*HubRole])))
            for _ in range(chance.randrange(1, 6)):
                try:
                    client.send(hostile_packet(chance))
                except OSError:
                    break  # the hub has disconnected the client
    master, observer = join(hub, HubRole.MASTER), join(hub, HubRole.OBSERVER)
    received = b""
    for _ in range(PATIENCE):
        master.post(0x123, b"still on", 8)
        master.wait(master.now_ns + 5_000_000)
        frames = observer.wait(time.monotonic_ns() + 100_000_000)
        received += b"".join(frame.data for frame in frames)
        if b"still on" in received:
            return
    raise AssertionError("the honest clients were not served")


def test_a_master_that_leaves_before_admission_delays_nobody(serve: Serve) -> None:
    hub = serve()
    for _ in range(20):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
            connect(client, hub)
            client.send(pack(PacketKind.HELLO, HubRole.MASTER))
    master = join(hub, HubRole.MASTER)
    assert master.wait(master.now_ns + 5_000_000) == []
