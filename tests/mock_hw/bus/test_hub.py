"""The bus hub is exact and repeatable in lock-step, punctual in real time, and robust to bad
clients.
"""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from config.errors import TransportError
from mock_hw.bus.arbitration import WireFrame
from mock_hw.bus.hub import AFTER_RUN_NS
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import listening_socket
from mock_hw.bus.hub_protocol import FRAME, HubRole, PacketKind, pack
from mock_hw.bus.wire_time import INTERMISSION_BITS, wire_bits
from tests.builders.raised_codes import raises_code

MS = 1_000_000
SYNC_END_NS = (51 - 3) * 1000
Serve = Callable[..., Any]


def test_a_wait_ends_exactly_at_its_time(serve: Serve) -> None:
    client = serve().join(HubRole.MASTER)
    start_s = time.monotonic()
    for until_ns in (1, 8 * MS, 3_600_000 * MS):
        assert client.wait(until_ns) == []
        assert client.now_ns == until_ns
    assert time.monotonic() - start_s < 600.0, "an hour of bus time takes less than 10 minutes"


def test_a_frame_arrives_after_its_time_on_the_wire(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE)
    device.post(0x181, b"12345678", 8, time_ns=5 * MS)
    device.begin_wait(on_frames=False)
    master = hub.join(HubRole.MASTER)
    (frame,) = master.wait(10 * MS)
    bits = wire_bits(0x181, b"12345678")
    assert frame.time_ns == 5 * MS + (bits - 3) * 1000
    assert master.now_ns == frame.time_ns


def test_a_burst_wakes_its_receiver_once_in_the_order_of_identifiers(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE)
    for port, can_id in enumerate((0x183, 0x181, 0x182)):
        device.post(can_id, bytes(8), 8, port, time_ns=MS)
    device.begin_wait(on_frames=False)
    master = hub.join(HubRole.MASTER)
    frames = master.wait(10 * MS)
    assert [frame.can_id for frame in frames] == [0x181, 0x182, 0x183]
    assert master.now_ns == frames[-1].time_ns


def test_urgent_identifiers_wake_at_once_and_others_are_delivered_with_them(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE, (0x080,))
    device.begin_wait(10 * MS, on_frames=False)
    master = hub.join(HubRole.MASTER)
    master.post(0x201, bytes(8), 8, time_ns=1 * MS)
    master.post(0x080, b"", 0, time_ns=4 * MS)
    master.begin_wait(on_frames=False)
    frames = device.end_wait()
    assert [frame.can_id for frame in frames] == [0x201, 0x080]
    assert frames[0].time_ns < 2 * MS
    assert device.now_ns == frames[1].time_ns == 4 * MS + SYNC_END_NS


def test_frames_are_kept_during_a_sleep(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE)
    device.post(0x181, b"", 0, time_ns=MS)
    device.begin_wait(on_frames=False)
    master = hub.join(HubRole.MASTER)
    (frame,) = master.wait(5 * MS, on_frames=False)
    assert master.now_ns == 5 * MS
    assert frame.time_ns < 2 * MS


def test_simulated_time_stops_while_a_master_works(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE)
    device.begin_wait(3 * MS)
    master = hub.join(HubRole.MASTER)
    assert not select.select([device], [], [], 0.1)[0]
    master.wait(2 * MS)
    assert master.now_ns == 2 * MS
    assert not select.select([device], [], [], 0.1)[0]
    master.begin_wait()
    assert device.end_wait() == []
    assert device.now_ns == 3 * MS


def test_an_observer_receives_everything_and_never_stops_time(serve: Serve) -> None:
    hub = serve()
    observer = hub.join(HubRole.OBSERVER)
    assert observer.simulated_time
    assert not observer.lockstep
    master = hub.join(HubRole.MASTER)
    for cycle in range(2000):
        master.post(0x080, b"", 0)
        master.wait((cycle + 1) * 8 * MS)
    received: list[WireFrame] = []
    while len(received) < 2000 and (frames := observer.wait(time.monotonic_ns() + 2000 * MS)):
        received += frames
    assert [f.time_ns for f in received] == [k * 8 * MS + SYNC_END_NS for k in range(2000)]


def test_without_a_master_time_continues_in_real_time_and_then_stops(serve: Serve) -> None:
    hub = serve()
    device = hub.join(HubRole.DEVICE)
    device.begin_wait(5 * MS)
    master = hub.join(HubRole.MASTER)
    assert master.now_ns == 0
    start_ns = time.monotonic_ns()
    master.close()
    device.end_wait()
    device.wait(100 * MS)
    assert time.monotonic_ns() - start_ns > 95 * MS
    device.begin_wait()
    master = hub.join(HubRole.MASTER)
    assert master.now_ns == AFTER_RUN_NS
    assert time.monotonic_ns() - start_ns < AFTER_RUN_NS, (
        "simulated time must run ahead of real time while a master waits"
    )


def test_with_a_pace_nothing_is_delivered_before_its_time(serve: Serve) -> None:
    # bus time starts with the first master, which is later than this
    start_ns = time.monotonic_ns()
    client = serve(pace=2.0).join(HubRole.MASTER)
    for until_ns in (8 * MS, 30 * MS, 200 * MS):
        assert client.wait(until_ns) == []
        assert client.now_ns == until_ns
        assert time.monotonic_ns() - start_ns >= until_ns // 2 - 2 * MS


def test_an_interrupted_wait_does_not_end_the_next_one(serve: Serve) -> None:
    client = serve().join(HubRole.MASTER)
    client.begin_wait(5 * MS)
    client.wait(9 * MS)
    assert client.now_ns == 9 * MS


def test_real_time_delivers_after_the_frames_time_on_the_wire(serve: Serve) -> None:
    hub = serve(realtime=True, bitrate=10_000)
    sender = hub.join(HubRole.MASTER)
    receiver = hub.join(HubRole.OBSERVER)
    assert not sender.simulated_time
    start_ns = time.monotonic_ns()
    sender.send(0x080, b"", 0)
    (frame,) = receiver.wait(start_ns + 1000 * MS)
    assert time.monotonic_ns() - start_ns >= 48 * 100_000
    assert 48 * 100_000 <= frame.time_ns - start_ns < 500 * MS


def test_the_computing_time_of_a_device_does_not_delay_its_frames(serve: Serve) -> None:
    hub = serve(realtime=True, bitrate=1_000_000)
    device, receiver = hub.join(HubRole.DEVICE), hub.join(HubRole.OBSERVER)
    wire_ns = 1000 * (wire_bits(0x181, b"", 0) - INTERMISSION_BITS)

    def backdated() -> int:
        """Post a frame 0.5 ms after its time stamp; return how late it then arrives [ns]."""
        answered_ns = time.monotonic_ns()
        while time.monotonic_ns() < answered_ns + MS // 2:
            pass
        device.post(0x181, b"", 0, 1, answered_ns)
        device.wait(0)
        (frame,) = receiver.wait(answered_ns + 1000 * MS)
        return frame.time_ns - wire_ns - answered_ns

    later_ns = [backdated() for _ in range(50)]
    assert all(late >= 0 for late in later_ns)
    assert 0 in later_ns, "at least one frame must be exactly on time"


def test_real_time_waits_end_on_the_clock(serve: Serve) -> None:
    client = serve(realtime=True).join(HubRole.MASTER)
    until_ns = time.monotonic_ns() + 20 * MS
    assert client.wait(until_ns) == []
    assert client.now_ns >= until_ns


@pytest.mark.parametrize(
    "last_words",
    [
        b"",
        b"\x04",
        pack(PacketKind.SEND) + b"half a frame",
        pack(PacketKind.SEND) + FRAME.pack(0, 0x80, 9, 0, b""),
        pack(PacketKind.WAKE),
        bytes(24),
    ],
)
@pytest.mark.parametrize("realtime", [False, True])
def test_a_client_that_dies_or_sends_garbage_does_not_affect_others(
    serve: Serve, last_words: bytes, realtime: bool
) -> None:
    hub = serve(realtime=realtime)
    other = hub.join(HubRole.OBSERVER)
    dying = hub.join(HubRole.MASTER)
    if last_words:
        with socket.socket(fileno=os.dup(dying.fileno())) as wire:
            wire.send(last_words)
    dying.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.connect(str(hub.path))
        stranger.send(b"hello?")
    master = hub.join(HubRole.MASTER)
    master.post(0x080, b"", 0)
    master.wait(master.now_ns + MS)
    assert [f.can_id for f in other.wait(time.monotonic_ns() + 2000 * MS)] == [0x080]


def test_an_observer_that_does_not_read_loses_frames_and_delays_nobody(serve: Serve) -> None:
    hub = serve()
    hub.join(HubRole.OBSERVER)
    master = hub.join(HubRole.MASTER)
    for _ in range(3000):
        master.post(0x181, bytes(8), 8)
        master.wait(master.now_ns + MS)
    assert master.now_ns == 3000 * MS


def test_the_log_has_the_format_of_candump(serve: Serve) -> None:
    hub = serve()
    master = hub.join(HubRole.MASTER)
    master.post(0x601, bytes.fromhex("4000100000000000"), 8, time_ns=1_500 * MS)
    master.post(0x4000_0701, b"", 1, time_ns=2_000 * MS)
    master.post(0x9ABC_DEF0, b"x", 1, time_ns=3_000 * MS)
    master.wait(4_000 * MS)
    took_us = [
        wire_bits(can_id, data, length) - 3
        for can_id, data, length in (
            (0x601, bytes.fromhex("4000100000000000"), 8),
            (0x4000_0701, b"", 1),
            (0x9ABC_DEF0, b"x", 1),
        )
    ]
    assert hub.log.getvalue().splitlines() == [
        f"(0000000001.500{took_us[0]}) test 601#4000100000000000",
        f"(0000000002.0000{took_us[1]}) test 701#R1",
        f"(0000000003.0000{took_us[2]}) test 1ABCDEF0#78",
    ]


def test_a_second_hub_on_the_socket_is_refused(serve: Serve) -> None:
    hub = serve()
    with (
        raises_code(TransportError, "RID-MOCK-SERVED"),
        listening_socket(hub.path),
    ):
        pass


def test_a_socket_of_a_killed_hub_is_reused(serve: Serve) -> None:
    hub = serve()
    stale = hub.path.with_name("stale.sock")
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as dead:
        dead.bind(str(stale))
    with listening_socket(stale):
        assert stale.is_socket()
    assert not stale.exists()


def test_a_channel_without_a_hub_is_an_error_with_its_name(serve: Serve) -> None:
    path = serve().path.with_name("nobody.sock")
    with raises_code(TransportError, "RID-MOCK-NOT-SERVED", "nobody.sock"):
        HubClient(path, HubRole.OBSERVER)
