"""Pages name the service's time zone by a name that every browser knows."""

from __future__ import annotations

import os

import pytest

from rid_daq.workbench.visit import _zone


@pytest.mark.parametrize(
    ("variable", "name"),
    [("Europe/Berlin", "Europe/Berlin"), (":Asia/Tokyo", "Asia/Tokyo"), ("UTC", "UTC")],
)
def test_the_zone_of_the_environment_is_used(
    monkeypatch: pytest.MonkeyPatch, variable: str, name: str
) -> None:
    monkeypatch.setenv("TZ", variable)
    assert _zone() == name


@pytest.mark.parametrize("variable", ["posix/Europe/Berlin", "right/UTC", "Factory", "no/zone", ""])
def test_a_zone_that_browsers_reject_is_replaced(
    monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    resolve = os.path.realpath  # importing a zone's data resolves other paths

    def resolve_link(path: str, **options: bool) -> str:
        right = "/usr/share/zoneinfo/right/Europe/Berlin"
        return right if path == "/etc/localtime" else resolve(path, **options)

    monkeypatch.setattr("os.path.realpath", resolve_link)
    monkeypatch.setenv("TZ", variable)
    assert _zone() == "UTC"
