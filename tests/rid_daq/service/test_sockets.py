"""Addresses of a service for programs on this computer."""

from __future__ import annotations

import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from config.errors import ConfigError
from rid_daq.service.client import ServiceClient
from rid_daq.service.sockets import local_listener, local_sockets, socket_path_of
from tests.builders.raised_codes import raises_code


@pytest.fixture(autouse=True)
def _own_runtime_directory(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as short:  # the name of a socket must be short
        monkeypatch.setenv("XDG_RUNTIME_DIR", short)
        yield


def test_a_client_can_connect_before_the_server_accepts(tmp_path: Path) -> None:
    with (
        local_listener(tmp_path) as (listener, path),
        socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client,
    ):
        client.connect(str(path))
        client.sendall(b"GET")
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.recv(3) == b"GET"


def test_the_socket_is_private_and_deleted_at_the_end(tmp_path: Path) -> None:
    with local_listener(tmp_path) as (_, path):
        assert path == socket_path_of(tmp_path)
        assert path.stat().st_mode & 0o077 == 0
        assert local_sockets() == [path]
    assert not path.exists()


def test_the_socket_of_a_service_that_was_killed_is_replaced(tmp_path: Path) -> None:
    path = socket_path_of(tmp_path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as killed:
        killed.bind(str(path))
    assert local_sockets() == []
    with local_listener(tmp_path):
        assert local_sockets() == [path]


def test_local_is_refused_unless_exactly_one_service_runs(
    tmp_path: Path,
) -> None:
    with raises_code(ConfigError, "RID-SERVICE-ADDRESS", str(tmp_path)):
        ServiceClient.at(str(tmp_path))
    with raises_code(ConfigError, "RID-SERVICE-UNREACHABLE"):
        ServiceClient.at("local")
    places = [tmp_path / "a", tmp_path / "b"]
    with (
        local_listener(places[0]),
        local_listener(places[1]),
        raises_code(ConfigError, "RID-SERVICE-ADDRESS", *map(str, map(socket_path_of, places))),
    ):
        ServiceClient.at("local")
