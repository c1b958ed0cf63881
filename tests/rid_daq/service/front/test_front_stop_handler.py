"""`FrontStopHandler`: who is allowed to stop, which process is stopped, and the kind of the
stop.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from acquisition.task.control_block import ControlBlock
from rid_daq.service.front.front_stop_handler import FrontStopHandler
from rid_daq.service.refusals import NotKnownError, UnknownError
from rid_daq.service.stop.stop_answer import stop_each
from rid_daq.web.request_secrets import hash_secret
from tests.builders.raised_codes import raises_code


def handler() -> tuple[FrontStopHandler, list[tuple[str, str]]]:
    messages: list[tuple[str, str]] = []
    return FrontStopHandler(
        ["a", "b"], lambda target, who: messages.append((target, who))
    ), messages


@pytest.mark.promise("stop-by-any-token-ever-issued")
def test_the_front_process_accepts_stops_with_issued_secrets_only() -> None:
    found, _ = handler()
    shown = {"authorization": "Bearer secret"}
    with raises_code(NotKnownError, "RID-STOP-UNKNOWN"):
        found.identify_sender(shown, local=False, address="192.0.2.7")
    assert found.identify_sender(shown, local=False, address="127.0.0.1") == ""
    assert found.identify_sender({}, local=True, address="") == ""
    found.note_issued([hash_secret("secret")])
    key = hash_secret("secret")
    for headers in (
        shown,
        {"cookie": "a=b; any-name=secret"},
        {"sec-websocket-protocol": "rid-daq, rid-daq.secret"},
    ):
        assert found.identify_sender(headers, local=False, address="192.0.2.7") == key


def test_the_front_process_stops_known_jobs_and_reports_to_the_service() -> None:
    found, messages = handler()
    assert not found.stop("a", "").sent
    found.note_jobs({"a": os.getpid()})
    control = ControlBlock.create()
    assert found.stop("*", "key").sent
    assert control.program.stop_code
    control.program.declare_task_gone()
    found.note_jobs({"b": 0})
    assert not found.stop("a", "").sent
    assert found.stop("b", "").sent, "the worker is starting: the service receives the stop"
    with raises_code(UnknownError, "RID-CELL-UNKNOWN", "'c'"):
        found.stop("c", "")
    assert messages == [("a", ""), ("*", "key"), ("a", ""), ("b", "")]


def test_a_worker_without_a_motion_is_ended_by_a_signal() -> None:
    found, _ = handler()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as worker:
        found.note_jobs({"a": worker.pid})
        assert found.stop("a", "").sent
        assert worker.wait(60.0) == -signal.SIGTERM


def test_a_process_is_identified_by_its_descriptor_and_not_by_its_id(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: list[int] = []
    by_number = os.pidfd_open

    def open_it(pid: int) -> int:
        opened.append(pid)
        return by_number(pid)

    monkeypatch.setattr(os, "pidfd_open", open_it)
    found, _ = handler()
    found.note_jobs({"a": os.getpid()})
    found.note_jobs({"a": os.getpid(), "b": 0})
    assert opened == [os.getpid()]


def test_a_failed_stop_does_not_prevent_stops_of_other_cells() -> None:
    stopped, wrong = list[str](), list[str]()

    def stop(cell: str) -> bool:
        if cell == "a":
            raise RuntimeError
        stopped.append(cell)
        return True

    assert stop_each(["a", "b"], stop, wrong.append).sent
    assert (stopped, wrong) == (["b"], ["a"])
