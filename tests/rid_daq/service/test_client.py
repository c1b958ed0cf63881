"""Errors of `ServiceClient` if a service does not answer or closes the connection."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from config.errors import ServiceError
from rid_daq.service import client as of_client
from rid_daq.service.client import JobResult, ServiceClient
from rid_daq.service.records import JobState
from tests.builders.raised_codes import raises_code
from tests.rid_daq.service.conftest import job


@contextmanager
def listening_client(
    folder: Path, handler: Callable[[socket.socket], None] = lambda _: None
) -> Iterator[ServiceClient]:
    """Listen at a service's address, and handle each connection with the given function."""
    kept = []
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "s"))
        listener.listen()

        def accept() -> None:
            while True:
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return
                kept.append(connection)
                handler(connection)

        thread = threading.Thread(target=accept)
        thread.start()
        try:
            with ServiceClient.at(str(folder / "s")) as client:
                yield client
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            thread.join()
            for connection in kept:
                connection.close()


@pytest.mark.parametrize("name", ["_PATIENCE_S", "_STOP_PATIENCE_S"])
def test_a_service_that_does_not_answer_gives_a_timeout_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(of_client, name, 0.02)
    with listening_client(tmp_path) as client:
        call = client.cells if name == "_PATIENCE_S" else lambda: client.stop("arm")
        with raises_code(ServiceError, "RID-SERVICE-UNREACHABLE", "0.02", "s"):
            call()


def test_a_broken_connection_gives_the_same_error_for_every_request(tmp_path: Path) -> None:
    (tmp_path / "motion.yaml").write_text("kind: fourier\n")
    with listening_client(tmp_path, lambda connection: connection.close()) as client:
        for call in (
            client.cells,
            lambda: client.stop("arm"),
            lambda: client.put_file(tmp_path / "motion.yaml", "motion.yaml"),
            lambda: client.get_run_file("01", "report.html"),
        ):
            with raises_code(ServiceError, "RID-SERVICE-UNREACHABLE"):
                call()


@pytest.mark.parametrize(("method", "times"), [("GET", 2), ("PUT", 2), ("DELETE", 2), ("POST", 1)])
def test_only_a_repeatable_request_is_sent_again_after_a_closed_connection(
    tmp_path: Path, method: str, times: int
) -> None:
    connections: list[socket.socket] = []

    def close_the_first(connection: socket.socket) -> None:
        connections.append(connection)
        if len(connections) == 1:
            connection.close()
            return
        connection.recv(1024)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]")

    with listening_client(tmp_path, close_the_first) as client:
        if times == 2:
            assert client.ask(method, "/cells") == []
        else:
            with raises_code(ServiceError, "RID-SERVICE-UNREACHABLE"):
                client.ask(method, "/cells")
    assert len(connections) == times


def test_a_stop_is_sent_again_after_a_closed_connection(tmp_path: Path) -> None:
    requests: list[bytes] = []

    def close_the_first(connection: socket.socket) -> None:
        requests.append(connection.recv(1024))
        if len(requests) == 2:
            connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}")
        connection.close()

    with listening_client(tmp_path, close_the_first) as client:
        client.stop("arm")
    assert [each.split()[:2] for each in requests] == [[b"POST", b"/api/v1/cells/arm/stop"]] * 2


def test_require_done_refuses_a_failed_job() -> None:
    failed = job("record").model_copy(update={"state": JobState.FAILED, "reason": "stopped"})
    with raises_code(ServiceError, "RID-JOB-NOT-DONE", failed.id, "record", "failed", "stopped"):
        JobResult(failed, None, None).require_done()
