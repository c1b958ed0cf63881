"""The front process: STOP reaches the motion while the service hangs; a dead one is replaced."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskState
from rid_daq.service.records import JobState
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.moving import (
    begin_motion,
    front_process,
    leased_cell,
    served_port,
    until,
)

pytestmark = pytest.mark.slow
STOPPING = {"X-Rid-Daq": "stop"}


def post_stop(served: ServedProcess, path: str = "/api/v1/stop") -> dict[str, Any]:
    answer = httpx.post(
        f"http://127.0.0.1:{served_port(served)}{path}", headers=STOPPING, timeout=60.0
    )
    assert answer.status_code == 202, answer.text
    answer_body: dict[str, Any] = answer.json()
    return answer_body


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    with serving(tmp_path_factory.mktemp("front")) as found:
        yield found


@pytest.mark.promise("stop-while-the-service-hangs")
@pytest.mark.parametrize("way", ["http", "line"])
def test_a_stop_reaches_the_motion_while_the_service_hangs(
    running: ServedProcess, long_motion: str, way: str
) -> None:
    with leased_cell(running, long_motion) as key:
        job = begin_motion(running, key)
        with running.client as client:
            pid = client.job(job.id).pid
        assert pid is not None
        control = ControlBlock.of_process(pid)
        assert control is not None
        url = f"ws://127.0.0.1:{served_port(running)}/api/v1/stop-line"
        with connect(url) as line:
            running.process.send_signal(signal.SIGSTOP)
            try:
                if way == "http":
                    assert post_stop(running, "/api/v1/cells/ir361/stop")["sent"]
                else:
                    line.send(json.dumps({"stop": "ir361", "number": 1}))
                    while (answer_body := json.loads(line.recv(60.0)))["type"] != "stopped":
                        pass
                    assert answer_body["sent"]
                until(lambda: control.task.state is TaskState.FINISHED)
            finally:
                running.process.send_signal(signal.SIGCONT)
        with running.client as client:
            until(lambda: client.job(job.id).state.is_over)
            over = client.job(job.id)
        assert (over.state, over.reason) == (JobState.STOPPED, "stopped by a user")


@pytest.mark.promise("stop-while-the-service-hangs")
def test_a_front_process_that_dies_is_replaced(running: ServedProcess) -> None:
    until(lambda: front_process(running) is not None)
    first = front_process(running)
    assert first is not None
    os.kill(first, signal.SIGKILL)
    until(lambda: front_process(running) not in (None, first))
    assert not post_stop(running)["sent"]
    with running.client as client:
        assert client.cell("ir361").cell == "ir361"
