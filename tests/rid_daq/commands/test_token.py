"""`rid-daq token`: without a token, the owner of a service's folder adds tokens and devices."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest

from rid_daq.app import run
from tests.builders.console_blocks import assert_shown
from tests.rid_daq.service.conftest import ServedProcess, shared

__all__ = ["shared"]

HEADERS = {"x-rid-daq": "test", "content-type": "application/json"}


def role_of(served: ServedProcess, secret: str) -> str:
    service = served.url.partition("/?")[0]
    shown = {"authorization": f"Bearer {secret}"}
    return str(httpx.get(f"{service}/api/v1/whoami", headers=shown).json()["role"])


@pytest.mark.promise("lost-token")
def test_a_lost_administrator_token_is_replaced(
    shared: ServedProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["token", "anna", "--role", "administrator", "--folder", str(shared.folder), "--json"]
    assert run(words) == 0
    made = json.loads(capsys.readouterr().out)
    assert role_of(shared, made["token"]) == "administrator"


@pytest.mark.promise("lost-token")
@pytest.mark.parametrize("role", ["operator", "administrator"])
def test_a_device_is_paired_by_its_code(
    role: str, shared: ServedProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    service = shared.url.partition("/?")[0]
    begun = httpx.post(f"{service}/api/v1/pairing", headers=HEADERS, json={}).json()
    code = f"{begun['code'][:3]} {begun['code'][3:]}"
    words = ["token", "my laptop", "--code", code, "--folder", str(shared.folder)]
    named = [] if role == "operator" else ["--role", role]
    assert run([*words, *named]) == 0
    if named:
        command = 'rid-daq token "my laptop" --role administrator --code 123456'
        assert_shown("run-the-service", command, capsys.readouterr().out)
    body = {"secret": begun["secret"]}
    state = httpx.post(f"{service}/api/v1/pairing/state", headers=HEADERS, json=body).json()
    assert role_of(shared, state["key"]) == role


def test_pairing_without_a_service_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["token", "anna", "--folder", str(tmp_path)]) == 2
    assert "RID-TOKEN-NO-SERVICE" in capsys.readouterr().err
