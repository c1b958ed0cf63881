"""A served real cell: a recording needs an axis test through the service, and a check after it.

The drives are simulated; `rid-daq mock` serves them on a separate bus.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.sync.client import connect

from config.errors import LockedError, PreflightError
from config.load import LoadedCell, load_cell
from rid_daq.preflight.axis_test import AXIS_TEST
from rid_daq.preflight.last_pose import LAST_POSE, known_pose, store_pose
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import CellState, Job
from tests.mock_hw.test_bus_acceptance import patient_cell
from tests.rid_daq.service.conftest import PATIENCE_S, ServedProcess, serving
from tests.rid_daq.service.moving import CHECK, events, is_in_motion, until
from tests.rid_daq.service.test_held_keys import Holder

pytestmark = [pytest.mark.slow, pytest.mark.alone]

PRESS_S = 10.0
JOBS = "/cells/ir361/jobs"


@pytest.fixture
def drives(tmp_path: Path) -> Iterator[Path]:
    """Return the file of a cell that counts as real, while its simulated drives run."""
    group = f"239.74.163.9@{20_000 + os.getpid() % 20_000}"
    safety = load_cell("ir361").config.drive_safety  # a real cell has shorter timeouts
    config = patient_cell("udp_multicast", group).config
    config = config.model_copy(update={"drive_safety": safety})
    (tmp_path / "drives.json").write_text(config.model_dump_json())
    real = config.model_dump(mode="json") | {"simulated": False, "plant": None}
    (tmp_path / "cell.json").write_text(json.dumps(real))
    command = [sys.executable, "-m", "rid_daq", "mock", str(tmp_path / "drives.json")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as mock:
        assert mock.stdout is not None
        mock.stdout.readline()  # the bus is being served
        try:
            yield tmp_path / "cell.json"
        finally:
            mock.terminate()


@pytest.fixture
def served(drives: Path, motion: str) -> Iterator[ServedProcess]:
    (drives.parent / "motion.yaml").write_text(motion)
    with serving(drives.parent, cell=str(drives)) as running:
        yield running


def begin(client: ServiceClient, lease: str, kind: str, **request: object) -> Job:
    body = {"kind": kind, "request": request, "cleared": True}
    return Job.model_validate(client.ask("POST", JOBS, body, lease))


def check_lines(client: ServiceClient, lease: str, **request: object) -> list[dict[str, str]]:
    """Check the cell; return the lines of the preflight."""
    client.follow(begin(client, lease, "check", **CHECK, **request))
    lines: list[dict[str, str]] = client.ask("GET", "/cells/ir361/preflight")["lines"]
    return lines


def red_values(lines: list[dict[str, str]]) -> dict[str, str]:
    """Return the found values of the red lines by their subject."""
    return {line["what"]: line["found"] for line in lines if line["verdict"] == "red"}


def open_question(client: ServiceClient, job: Job) -> dict[str, object] | None:
    job_events = events(client, job)
    answered_ids = {each["question"] for each in job_events if each["kind"] == "answered"}
    questions = [each for each in job_events if each["kind"] == "asked"]
    return next((each for each in questions if each["question"] not in answered_ids), None)


def answer_axis_test(client: ServiceClient, job: Job, lease: str, holder: Holder) -> None:
    """Hold the key for every axis, and answer for each that it has turned by two degrees."""
    end_s = time.monotonic() + PATIENCE_S
    while not client.job(job.id).state.is_over:
        assert time.monotonic() < end_s, events(client, job)[-3:]
        question = open_question(client, job)
        if question is None:
            time.sleep(0.05)
        elif question["form"] == "hold":
            holder.hold(" ")
            until_s = time.monotonic() + PRESS_S
            while open_question(client, job) == question and time.monotonic() < until_s:
                time.sleep(0.05)
            holder.hold("")
        else:
            text = "+" if question["choices"] else "2"
            body = {"question": question["question"], "text": text}
            with contextlib.suppress(
                LockedError
            ):  # the client receives the question slightly later
                client.ask("POST", f"/jobs/{job.id}/answer", body, lease)
            time.sleep(0.1)


@pytest.mark.promise("served-axis-test")
def test_a_real_cell_is_recorded_after_an_axis_test_through_the_service(
    served: ServedProcess, drives: Path
) -> None:
    with served.client as client:
        lease = client.ask("POST", "/cells/ir361/lease", {"seconds": 3600.0})["key"]
        assert [*red_values(check_lines(client, lease))] == [AXIS_TEST]
        with pytest.raises(PreflightError) as refused:
            begin(client, lease, "record", motion="motion.yaml")
        assert refused.value.refusal == "RID-CELL-NOT-READY"
        secret = client.ask(
            "POST", "/tokens", {"name": "anna", "role": "operator", "person": True}
        )["secret"]
        address = f"ws://{urlsplit(served.url).netloc}/api/v1/ws"
        headers = {"Authorization": f"Bearer {secret}"}
        job = begin(client, lease, "axes")
        with connect(address, additional_headers=headers, ping_interval=None) as socket:
            answer_axis_test(client, job, lease, Holder(socket, job.id, lease))
        client.follow(job).require_done()
        with pytest.raises(PreflightError):
            begin(client, lease, "record", motion="motion.yaml")  # another check is required first
        lines = check_lines(client, lease)
        assert red_values(lines) == {}
        (line,) = (line for line in lines if line["what"] == AXIS_TEST)
        assert line["found"].endswith(f", {job.owner}"), line
        assert client.cell("ir361").state is CellState.READY
        recording = begin(client, lease, "record", motion="motion.yaml")
        pid = client.job(recording.id).pid
        assert pid is not None
        until(lambda: is_in_motion(pid))
        client.stop("ir361")
        client.follow(recording)
        refuse_a_displaced_robot(client, lease, load_cell(str(drives)))


def refuse_a_displaced_robot(client: ServiceClient, lease: str, loaded: LoadedCell) -> None:
    """Require that a robot does not move if its pose differs from that after the last run."""
    assert red_values(check_lines(client, lease)) == {}
    known = known_pose(loaded, binding=True)
    assert known is not None
    assert known.source.startswith("run ")
    turn_rad = 2.0 * math.pi / abs(loaded.robot.joints[1].gear_ratio)
    store_pose(loaded, np.add(known.position, (0.0, turn_rad, 0.0)).tolist(), known.source)
    refused = begin(client, lease, "record", motion="motion.yaml")
    client.follow(refused)
    assert events(client, refused)[-1]["code"] == "RID-POSE-MOVED"
    assert [*red_values(check_lines(client, lease))] == [LAST_POSE]
    assert red_values(check_lines(client, lease, accept_pose=True)) == {}
    assert red_values(check_lines(client, lease)) == {}
