"""Limits on content and size of requests and files; invalid ones do no harm."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError
from rid_daq.service.api.app import make_api
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.client import ServiceClient
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Role
from rid_daq.service.request_check import check_request, request_schemas
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService

DEEP = b"[" * 100_000 + b"]" * 100_000


class Asker:
    """An administrator who sends bytes to a service in this process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.service = CellService(folder, [ServedCell("ir361", 20.0)])
        self.app = make_api(self.service, Authenticator(self.service.tokens, 0, secure=False))
        _, self.secret = self.service.tokens.add("anna", Role.ADMINISTRATOR, person=True)

    def ask(self, method: str, path: str, content: bytes | None = None) -> httpx.Response:
        headers = {"authorization": f"Bearer {self.secret}", "content-type": "application/json"}

        async def send_request() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, client=("192.0.2.7", 4711))
            async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
                return await client.request(method, path, content=content, headers=headers)

        return asyncio.run(send_request())


@pytest.fixture
def asker(tmp_path: Path) -> Asker:
    return Asker(tmp_path)


BODIES = [
    ("POST", "/api/v1/tokens", b'{"name": %s, "role": "viewer"}'),
    ("POST", "/api/v1/pairing/state", b'{"secret": %s}'),
    ("POST", "/api/v1/pairing/confirm", b'{"code": %s, "name": "x"}'),
    ("POST", "/api/v1/tickets", b'{"path": %s}'),
    ("POST", "/api/v1/cells/ir361/lease", b'{"note": %s}'),
    ("POST", "/api/v1/cells/ir361/jobs", b'{"kind": "record", "request": {"motion": %s}}'),
]


@pytest.mark.promise("strict-bodies")
@pytest.mark.parametrize(("method", "path", "body"), BODIES)
@pytest.mark.parametrize(
    "value", [rb'"\ud800"', rb'{"\udfff": 1}', b"NaN", b"1e999", b"9" * 50, b'{"a":1,"a":2}', DEEP]
)
def test_ambiguous_json_is_refused(
    asker: Asker, method: str, path: str, body: bytes, value: bytes
) -> None:
    answer = asker.ask(method, path, body % value)
    assert answer.status_code == 400
    assert answer.json()["code"] == "RID-REQUEST-JSON"


@pytest.mark.promise("bounded-texts")
@pytest.mark.parametrize(("method", "path", "body"), BODIES[:5])
def test_a_long_text_is_refused_and_not_quoted(
    asker: Asker, method: str, path: str, body: bytes
) -> None:
    answer = asker.ask(method, path, body % (b'"' + b"x" * 3000 + b'"'))
    assert answer.status_code == 422
    assert answer.json()["code"] == "RID-REQUEST-INVALID"
    assert len(answer.text) < 1000


@pytest.mark.promise("bounded-texts")
@pytest.mark.parametrize(
    ("kind", "request_", "code"),
    [
        (JobKind("jog"), {"label": "y" * 201}, "RID-REQUEST-LENGTH"),
        (JobKind("record"), {"motion": "m" * 300 + ".yaml"}, "RID-PATH-NAME"),
        (JobKind("record"), {"motion": "a\nb.yaml"}, "RID-PATH-NAME"),
        (JobKind("record"), {"motion": "a/" * 600 + "b.yaml"}, "RID-REQUEST-LENGTH"),
        (JobKind("identify"), {"names": ["a" * 199] * 200}, "RID-REQUEST-LENGTH"),
        (JobKind("loop"), {"run": "latest", "output": "runs"}, "RID-OUTPUT-ENDING"),
        (JobKind("loop"), {"run": "latest", "output": "cell4.pem"}, "RID-OUTPUT-ENDING"),
    ],
)
def test_oversized_requests_are_refused(
    tmp_path: Path, kind: JobKind, request_: dict[str, Any], code: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        check_request(kind, request_, tmp_path)
    assert refused.value.refusal == code


def _properties(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        for each in schema.values():
            yield from _properties(each)
    elif isinstance(schema, list):
        for each in schema:
            yield from _properties(each)


@pytest.mark.promise("no-outgoing-connections")
def test_no_request_has_a_field_for_an_address() -> None:
    names = {name for kind in request_schemas().values() for name in _properties(kind)}
    assert not {name for name in names if name in ("scheduler", "address", "host", "url", "port")}


@pytest.mark.promise("no-outgoing-connections")
@pytest.mark.parametrize("where", ["excitation", "multisine", ""])
def test_a_scheduler_is_refused_in_every_place(tmp_path: Path, where: str) -> None:
    named = {"scheduler": "tcp://127.0.0.1:8786"}
    excitation = {"period_s": 10.0, **(named if where == "excitation" else {})}
    request = {"output": "m.yaml", "kind": "excitation", "excitation": excitation, "multisine": {}}
    request |= {"multisine": named} if where == "multisine" else {} if where else named
    with pytest.raises(ConfigError) as refused:
        check_request(JobKind("design"), request, tmp_path)
    assert refused.value.refusal == "RID-REQUEST-INVALID"


@pytest.mark.promise("bad-files")
def test_invalid_files_in_the_folder_do_not_hide_the_others(asker: Asker) -> None:
    folder = asker.folder
    (folder / "good.yaml").write_text("kind: fourier\n")
    (folder / "deep.json").write_bytes(b'{"kind": "rid-daq estimate", "robot": ' + DEEP + b"}")
    (folder / "latin.yaml").write_bytes(b"kind: fourier\nrobot: \xff\xfe\n")
    os.mkfifo(folder / "pipe.yaml")
    (folder / "loop.yaml").symlink_to("loop.yaml")
    (folder / "gone.json").symlink_to("nowhere.json")
    (folder / "out.json").symlink_to("/etc/hostname")
    (Path(os.fsdecode(bytes(folder) + b"/half\xff.yaml"))).write_text("kind: fourier\n")
    (folder / "line\nbreak.yaml").write_text("kind: fourier\n")
    listed = asker.ask("GET", "/api/v1/files")
    assert listed.status_code == 200
    assert {each["path"] for each in listed.json()} == {"good.yaml", "deep.json", "latin.yaml"}
    motions = asker.ask("GET", "/api/v1/cells/ir361/files").json()["motions"]
    assert "good.yaml" in {each["path"] for each in motions}


@pytest.mark.promise("bad-files")
def test_an_invalid_file_cannot_be_uploaded(asker: Asker) -> None:
    for name, content, code in (
        ("deep.json", DEEP, "RID-FILE-JSON"),
        ("a" * 300 + ".json", b"{}", "RID-PATH-NAME"),
        ("key.pem", b"{}", "RID-FILE-ENDING"),
    ):
        answer = asker.ask("PUT", f"/api/v1/files/{name}", content)
        assert (answer.status_code, answer.json()["code"]) == (422, code)


@pytest.mark.promise("exclusive-put")
def test_a_file_name_is_reserved_from_the_start_of_an_upload(asker: Asker) -> None:
    target = asker.folder / "mine.yaml"
    with asker.service.uploads.reserve(target, "mine.yaml"):
        answer = asker.ask("PUT", "/api/v1/files/mine.yaml", b"kind: fourier\n")
        assert answer.json()["code"] == "RID-FILE-EXISTS"
        assert asker.ask("GET", "/api/v1/files").json() == []
    assert asker.ask("PUT", "/api/v1/files/mine.yaml", b"kind: fourier\n").status_code == 201
    again = asker.ask("PUT", "/api/v1/files/mine.yaml", b"kind: multisine\n")
    assert again.json()["code"] == "RID-FILE-EXISTS"
    assert target.read_text() == "kind: fourier\n"


@pytest.mark.promise("own-runs")
def test_only_runs_in_the_services_folder_are_found(
    asker: Asker, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    private = RunFolder.create(elsewhere, "private")
    private.finish(RunStatus.COMPLETE)
    private.path.rename(elsewhere / "private")
    monkeypatch.chdir(elsewhere)
    for rest in ("", "/manifest", "/report", "/result", "/files/report.html"):
        answer = asker.ask("GET", f"/api/v1/runs/private{rest}")
        assert (answer.status_code, answer.json()["code"]) == (404, "RID-RUN-UNKNOWN")


def test_an_ambiguous_run_is_not_reported_as_unknown(asker: Asker) -> None:
    one, _ = (RunFolder.create(asker.service.runs, "same", now_ns=10**18) for _ in range(2))
    answer = asker.ask("GET", f"/api/v1/runs/{one.run_id[:8]}")  # seconds, the same in both ids
    assert (answer.status_code, answer.json()["code"]) == (404, "RID-RUN-AMBIGUOUS")


@pytest.mark.promise("own-runs")
def test_a_run_that_contains_a_link_is_not_read(asker: Asker) -> None:
    run = RunFolder.create(asker.service.runs, "linked")
    run.finish(RunStatus.COMPLETE)
    assert asker.ask("GET", "/api/v1/runs/linked").status_code == 200
    run.file("result.json").symlink_to("/etc/hostname")
    answer = asker.ask("GET", "/api/v1/runs/linked/result")
    assert answer.status_code in (404, 422)
    assert Path("/etc/hostname").read_text() not in answer.text


@pytest.mark.promise("no-token-in-the-clear")
@pytest.mark.parametrize(
    "address", ["http://192.0.2.1:8642", "http://cell4:8642", "http://127.0.0.1@192.0.2.1"]
)
def test_a_token_is_not_sent_without_tls(address: str) -> None:
    with pytest.raises(ConfigError) as refused:
        ServiceClient.at(address, "secret")
    assert refused.value.refusal == "RID-SERVICE-PLAIN"


def test_tls_is_not_needed_on_this_computer() -> None:
    for address in ("http://127.0.0.1:8642", "http://[::1]:8642", "http://localhost:8642"):
        with ServiceClient.at(address, "secret"):
            pass


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=30),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner),
    max_leaves=20,
)


@pytest.mark.promise("no-document-breaks-a-request")
@pytest.mark.parametrize("kind", JobKind)
def test_every_random_document_is_accepted_or_refused(
    kind: JobKind, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("folder")
    names = sorted(request_schemas()[kind.value]["properties"]) or ["cell"]

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
    @given(st.dictionaries(st.sampled_from(names) | st.text(max_size=9), JSON, max_size=5))
    def check(request: dict[str, Any]) -> None:
        with contextlib.suppress(ConfigError):
            check_request(kind, request, folder)

    check()
    assert list(folder.iterdir()) == []


@pytest.mark.promise("bad-files")
@pytest.mark.parametrize("content", [DEEP, b'{"schema": NaN}', b"\xff\xfe", b"[]", b"{}"])
def test_a_damaged_run_does_not_affect_other_runs(asker: Asker, content: bytes) -> None:
    run = RunFolder.create(asker.service.runs, "damaged")
    run.file("result.json").write_bytes(content)
    run.finish(RunStatus.COMPLETE, {"robot": "ir361"})
    torn = RunFolder.create(asker.service.runs, "torn")
    torn.file("manifest.json").write_bytes(content)
    for path in ("", "/manifest", "/result", "/report"):
        for name in ("damaged", torn.run_id):
            assert asker.ask("GET", f"/api/v1/runs/{name}{path}").status_code < 500
    assert len(asker.ask("GET", "/api/v1/runs").json()) == 2
