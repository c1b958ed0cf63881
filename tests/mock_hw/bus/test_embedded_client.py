"""Devices in the process of the hub: other clients are served while they wait."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from config.errors import TransportError
from mock_hw.bus.embedded_client import EmbeddedClient
from mock_hw.bus.hub import CanHub
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_process import listening_socket
from mock_hw.bus.hub_protocol import HubRole

MS = 1_000_000


@pytest.fixture
def hub_path(tmp_path: Path) -> Iterator[Path]:
    """Serve a hub whose devices wait for 10 ms of simulated time, again and again."""
    path, ended, ready = tmp_path / "hub.sock", threading.Event(), threading.Event()

    def serve() -> None:
        with listening_socket(path) as listener:
            hub = CanHub(listener, 1_000_000, realtime=False)
            client = EmbeddedClient(hub, (), ended.is_set)
            ready.set()
            with contextlib.suppress(TransportError):
                while True:
                    client.post(0x181, b"\x01", 1)
                    client.wait(client.now_ns + 10 * MS, on_frames=False)
            hub.close()

    thread = threading.Thread(target=serve)
    thread.start()
    assert ready.wait(120.0)
    yield path
    ended.set()
    thread.join(120.0)
    assert not thread.is_alive()


def test_a_master_receives_the_frames_of_the_devices_with_their_times(hub_path: Path) -> None:
    master = HubClient(hub_path, HubRole.MASTER)
    frames = master.wait(master.now_ns + 100 * MS, on_frames=False)
    master.close()
    assert 9 <= len(frames) <= 11
    assert {(frame.can_id, frame.data[: frame.length]) for frame in frames} == {(0x181, b"\x01")}
    steps_ns = {after.time_ns - before.time_ns for before, after in pairwise(frames)}
    assert steps_ns == {10 * MS}


def test_a_client_can_join_while_no_wait_of_the_devices_pauses_time(hub_path: Path) -> None:
    master = HubClient(hub_path, HubRole.MASTER)
    master.begin_wait(
        on_frames=False
    )  # the master waits for ever, so time advances from one wait of the devices to the next
    HubClient(hub_path, HubRole.OBSERVER, timeout_s=30.0).close()
    master.close()
