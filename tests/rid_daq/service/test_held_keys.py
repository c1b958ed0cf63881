"""A key held over the WebSocket of a served cell, while processes are suspended."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.sync.client import ClientConnection, connect

from rid_daq.service.client import ServiceClient
from rid_daq.service.records import Job
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.moving import events, leased_cell, until

pytestmark = [pytest.mark.slow, pytest.mark.alone]

MOVING = 0.005
"""Fraction of the velocity limit above which a joint counts as moving."""


class Holder:
    """A program that answers every challenge while it holds a key, and observes the speed."""

    def __init__(self, socket: ClientConnection, job: str, lease: str) -> None:
        self._socket, self._job, self._lease = socket, job, lease
        self._saying = threading.Lock()
        self._sequence = 0
        self._newest: str | None = None
        self._key = ""
        self.speed = 0.0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for text in self._socket:
            message = json.loads(text)
            if message["type"] == "challenge":
                self._newest = message["value"]
                if self._key:
                    self._say(self._key)
            elif message["type"] == "samples":
                joints = message["picture"]["joints"] or []
                shares = [abs(each["velocity"] or 0.0) / each["velocity_limit"] for each in joints]
                self.speed = max(shares, default=0.0)

    def hold(self, key: str) -> None:
        self._say("")
        self._key = key
        if key:
            self._say(key)

    def press_until_motion(self) -> None:
        """Press repeatedly until a joint moves: a busy computer can end a press early.

        It first waits until the service has sent a challenge, which each message of the key must
        answer, and until no joint moves.
        """
        until(lambda: self._newest is not None and self.speed <= MOVING)
        for _ in range(20):
            self.hold("1+")
            end_s = time.monotonic() + 1.0
            while time.monotonic() < end_s:
                if self.speed > MOVING:
                    return
                time.sleep(0.02)
        raise AssertionError("nothing moved")

    def stays_at_rest(self, time_s: float) -> bool:
        end_s = time.monotonic() + time_s
        while time.monotonic() < end_s:
            if self.speed > MOVING:
                return False
            time.sleep(0.02)
        return True

    def _say(self, key: str) -> None:
        with self._saying:
            self._sequence += 1
            message = {"job": self._job, "lease": self._lease, "held": key}
            more = {"sequence": self._sequence, "challenge": self._newest}
            self._socket.send(json.dumps(message | more))


@contextmanager
def running_jog(served: ServedProcess, motion: str) -> Iterator[tuple[Holder, Job]]:
    """Start a jog that waits for keys, and yield a program that holds them."""
    with leased_cell(served, motion) as lease, served.client as client:
        body = {"kind": "jog", "request": {}}
        job = Job.model_validate(client.ask("POST", "/cells/ir361/jobs", body, lease))
        until(lambda: has_event(client, job, "Ready"))
        token_request = {"name": "holder", "role": "operator", "person": True}
        secret = client.ask("POST", "/tokens", token_request)["secret"]
        headers = {"Authorization": f"Bearer {secret}"}
        address = f"ws://{urlsplit(served.url).netloc}/api/v1/ws"
        with connect(address, additional_headers=headers, ping_interval=None) as socket:
            holder = Holder(socket, job.id, lease)
            yield holder, client.job(job.id)
            holder.hold("")
            client.ask("POST", f"/jobs/{job.id}/cancel", {})
            client.follow(job)


def has_event(client: ServiceClient, job: Job, words: str) -> bool:
    return any(words in str(each.get("text", "")) for each in events(client, job))


@pytest.fixture
def realtime_service(tmp_path: Path) -> Iterator[ServedProcess]:
    with serving(tmp_path, "--pace", "1") as running:
        yield running


@pytest.mark.promise("held-key-suspended")
@pytest.mark.parametrize("suspended", ["worker", "service"])
def test_a_key_held_during_a_suspension_moves_nothing_afterwards(
    realtime_service: ServedProcess, motion: str, suspended: str
) -> None:
    served = realtime_service
    with running_jog(served, motion) as (holder, job):
        pid = served.process.pid if suspended == "service" else job.pid
        assert pid is not None
        holder.press_until_motion()
        os.kill(pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.kill(pid, signal.SIGCONT)
        time.sleep(1.0)  # waiting samples are processed
        assert holder.stays_at_rest(2.0), "a key that was held throughout must be pressed again"
        with served.client as client:
            until(lambda: has_event(client, job, "link too slow"))
        holder.press_until_motion()
