"""Rules of the API: permissions, required states, and refusals."""

from __future__ import annotations

import asyncio
import json
from dataclasses import asdict
from typing import Any

import httpx
import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.preflight.check_line import CheckLine
from rid_daq.service.api.app import make_api
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import Preflight, Role
from rid_daq.service.service import CellService

HEARTBEAT = CheckLine("axis1, node 1", "heartbeat", "", "", "red")


class Api:
    """Client of a service in this process, with a token of each role."""

    def __init__(self, service: CellService) -> None:
        self.service = service
        self.door = Authenticator(service.tokens, 0, secure=False)
        self.app = make_api(service, self.door)
        self.secrets = {
            role: service.tokens.add(role.value, role, person=role is not Role.VIEWER)[1]
            for role in Role
        }

    def ask(
        self,
        role: Role | None,
        method: str,
        path: str,
        body: object = None,
        lease: str = "",
    ) -> httpx.Response:
        headers = {"x-rid-daq-lease": lease} if lease else {}
        if role is not None:
            headers["authorization"] = f"Bearer {self.secrets[role]}"

        async def send_request() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, client=("192.0.2.7", 4711))
            async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
                return await client.request(method, path, json=body, headers=headers)

        return asyncio.run(send_request())

    def lease(self, role: Role = Role.OPERATOR, **more: Any) -> str:
        answer = self.ask(role, "POST", "/api/v1/cells/ir361/lease", {"seconds": 60.0, **more})
        assert answer.status_code == 201, answer.text
        return str(answer.json()["key"])

    def make_ready(self) -> None:
        cell = self.service.cell("ir361")
        files_hash = cell.loaded.files_hash
        document: dict[str, object] = {"passed": True, "problem": None, "lines": []}
        self.service.readiness.note_check(cell, {**document, "files_hash": files_hash})


@pytest.fixture
def api(service: CellService) -> Api:
    return Api(service)


RECORD = {"kind": "record", "request": {"motion": "motion.yaml"}}
CHECK = {"kind": "check"}

READ = [
    "/api/v1/cells",
    "/api/v1/cells/ir361",
    "/api/v1/cells/ir361/preflight",
    "/api/v1/cells/ir361/lease",
    "/api/v1/cells/ir361/files",
    "/api/v1/jobs",
    "/api/v1/runs",
    "/api/v1/run-groups",
    "/api/v1/files",
    "/api/v1/requests",
    "/api/v1/whoami",
    "/metrics",
]


@pytest.mark.parametrize("path", READ)
def test_every_role_can_read(api: Api, path: str) -> None:
    assert api.ask(None, "GET", path).status_code == 401
    assert api.ask(Role.VIEWER, "GET", path).status_code == 200


def test_health_needs_no_token(api: Api) -> None:
    assert api.ask(None, "GET", "/api/v1/health").json()["status"] == "ok"


@pytest.mark.parametrize("path", ["/api/v1/tokens", "/api/v1/pairing", "/api/v1/audit"])
def test_only_an_administrator_can_list_tokens_pairings_and_audit(api: Api, path: str) -> None:
    assert api.ask(Role.OPERATOR, "GET", path).status_code == 403
    assert api.ask(Role.ADMINISTRATOR, "GET", path).status_code == 200


def test_a_viewer_can_neither_lease_a_cell_nor_start_a_job(api: Api) -> None:
    assert api.ask(Role.VIEWER, "POST", "/api/v1/cells/ir361/lease", {}).status_code == 403
    answer = api.ask(Role.VIEWER, "POST", "/api/v1/cells/ir361/jobs", RECORD)
    assert answer.status_code == 403
    assert answer.json()["code"] == "RID-ACCESS-ROLE"


def test_a_simulated_cell_is_marked(api: Api) -> None:
    answer = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()
    assert answer["simulated"] is True
    assert answer["pace"] == 20.0
    assert answer["state"] == "closed"
    assert answer["not_ready_because"] == "the cell has had no preflight yet: check the cell."


def test_a_job_on_the_cell_needs_its_lease(api: Api) -> None:
    answer = api.ask(Role.OPERATOR, "POST", "/api/v1/cells/ir361/jobs", CHECK)
    assert answer.status_code == 409
    assert answer.json()["code"] == "RID-LEASE-NONE"
    api.lease()
    answer = api.ask(Role.OPERATOR, "POST", "/api/v1/cells/ir361/jobs", CHECK, lease="guessed")
    assert answer.status_code == 409


def test_a_second_lease_of_a_cell_is_refused(api: Api) -> None:
    api.lease(Role.OPERATOR, note="weighing")
    body = {"seconds": 60.0}
    answer = api.ask(Role.ADMINISTRATOR, "POST", "/api/v1/cells/ir361/lease", body)
    assert answer.status_code == 409
    assert answer.json()["code"] == "RID-LEASE-OTHER"
    assert "weighing" in answer.json()["message"]
    assert api.lease(Role.ADMINISTRATOR, confirmed="ir361")


def test_a_motion_is_refused_if_the_cell_is_not_ready(api: Api) -> None:
    key = api.lease()
    answer = api.ask(Role.OPERATOR, "POST", "/api/v1/cells/ir361/jobs", RECORD, lease=key)
    assert answer.status_code == 409
    assert answer.json()["code"] == "RID-CELL-NOT-READY"


def test_a_fault_must_be_reset_by_a_person(api: Api) -> None:
    api.make_ready()
    cell = api.service.cell("ir361")
    stop = {"code": "FOLLOWING_ERROR", "text": "axis2 follows by 0.1 rad, 0.05 rad is allowed."}
    api.service.readiness.note_end(cell, {"stop": stop})
    answer = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()
    assert answer["state"] == "fault"
    assert "axis2 follows by 0.1 rad" in answer["not_ready_because"]
    api.service.readiness.note_reset(cell)
    answer = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()
    assert answer["state"] == "closed", "a motion needs a complete preflight again"
    assert (
        answer["not_ready_because"]
        == "a fault has stopped a motion after the preflight: repeat the preflight."
    )
    found = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361/preflight").json()
    assert found["void_because"] == answer["not_ready_because"]
    api.make_ready()
    assert api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()["state"] == "ready"


@pytest.mark.parametrize("code", ["STOP_BUTTON", "STOP_COMMAND", "INTERRUPTED", "CLIENT_LOST"])
def test_a_requested_stop_is_not_a_fault(api: Api, code: str) -> None:
    api.make_ready()
    cell = api.service.cell("ir361")
    api.service.readiness.note_end(cell, {"stop": {"code": code, "text": "stopped"}})
    assert api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()["state"] == "ready"


def test_a_red_preflight_is_not_ready(api: Api) -> None:
    cell = api.service.cell("ir361")
    document = {"passed": False, "problem": None, "lines": [asdict(HEARTBEAT)]}
    api.service.readiness.note_check(cell, document)
    answer = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361").json()
    assert answer["state"] == "closed"
    assert "preflight has failed" in answer["not_ready_because"]
    lines = api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361/preflight").json()
    assert Preflight.model_validate(lines).lines == (HEARTBEAT,)


def test_a_stop_needs_no_lease_and_no_role(api: Api) -> None:
    answer = api.ask(Role.VIEWER, "POST", "/api/v1/cells/ir361/stop")
    assert answer.status_code == 202
    assert answer.json() == {
        "sent": False,
        "sentence": "This service moves nothing in cell ir361 now.",
    }


def test_a_stop_from_another_computer_needs_a_token(api: Api) -> None:
    assert api.ask(None, "POST", "/api/v1/cells/ir361/stop").status_code == 401


@pytest.mark.parametrize(
    ("query", "labels"),
    [
        ("", ["foreign", "imported", "stopped", "first"]),
        ("cell=ir361", ["imported", "stopped", "first"]),
        ("cell=ir361&limit=1&offset=1", ["stopped"]),
        ("verdict=failed", ["stopped"]),
        ("status=stopped&search=ST", ["stopped"]),
        ("search=kr15", ["foreign"]),
    ],
)
def test_runs_are_filtered_by_the_service(api: Api, query: str, labels: list[str]) -> None:
    root, ir361 = api.service.runs, {"robot": "ir361", "cell": "ir361"}
    RunFolder.create(root, "first", facts=ir361)
    stopped = RunFolder.create(root, "stopped", facts=ir361)
    stopped.finish(RunStatus.STOPPED, {"verdict": "failed"})
    RunFolder.create(root, "imported", facts={"robot": "ir361"})
    RunFolder.create(root, "foreign", facts={"robot": "kr15", "cell": "kr15"})
    page = api.ask(Role.VIEWER, "GET", f"/api/v1/run-groups?{query}").json()
    assert [group["head"]["label"] for group in page["groups"]] == labels
    if "limit" not in query:
        runs = api.ask(Role.VIEWER, "GET", f"/api/v1/runs?{query}").json()
        assert [run["label"] for run in runs] == labels
        assert page["total"] == len(labels)
    assert api.ask(Role.VIEWER, "GET", f"/api/v1/runs?search={'x' * 101}").status_code == 422


@pytest.mark.parametrize(
    ("path", "status", "code"),
    [
        ("/api/v1/cells/kr15", 404, "RID-CELL-UNKNOWN"),
        ("/api/v1/jobs/none", 404, "RID-JOB-UNKNOWN"),
        ("/api/v1/runs/none", 404, "RID-RUN-UNKNOWN"),
        ("/api/v1/files/none.yaml", 404, "RID-FILE-UNKNOWN"),
        ("/api/v1/files/..%2F..%2Fetc%2Fpasswd", 422, "RID-PATH-OUTSIDE"),
        ("/api/v1/files/.rid-daq-service/service.db", 422, "RID-PATH-HIDDEN"),
        ("/api/v1/files/.rid-daq-service/jobs/x.json", 422, "RID-PATH-HIDDEN"),
    ],
)
def test_unknown_names_and_paths_outside_the_folder_are_refused(
    api: Api, path: str, status: int, code: str
) -> None:
    answer = api.ask(Role.OPERATOR, "GET", path)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_a_path_outside_the_runs_folder_is_not_found(api: Api) -> None:
    assert api.ask(Role.OPERATOR, "GET", "/api/v1/runs/..").status_code == 404


@pytest.mark.parametrize("name", ["report", "result", "files/report.html"])
def test_a_missing_report_is_not_found(api: Api, name: str) -> None:
    run = RunFolder.create(api.service.runs, "fresh").run_id
    answer = api.ask(Role.VIEWER, "GET", f"/api/v1/runs/{run}/{name}")
    assert answer.status_code == 404
    assert answer.json()["code"] == "RID-RUN-FILE"
    assert run in answer.json()["message"]


def test_an_invalid_request_is_refused_before_it_becomes_a_job(api: Api) -> None:
    api.make_ready()
    key = api.lease()
    for request, code, field in [
        ({"motion": "../../motion.yaml"}, "RID-PATH-OUTSIDE", "'../../motion.yaml'"),
        ({"motion": "m.yaml", "sped": 2}, "RID-REQUEST-INVALID", "sped"),
        ({}, "RID-REQUEST-INVALID", "motion"),
    ]:
        body = {"kind": "record", "request": request}
        answer = api.ask(Role.OPERATOR, "POST", "/api/v1/cells/ir361/jobs", body, lease=key)
        assert answer.status_code == 422
        assert answer.json()["code"] == code
        assert f"{field}:" in answer.json()["message"]
    assert api.service.jobs.newest() == []


def test_a_file_can_be_uploaded_once_and_read(api: Api) -> None:
    put = api.ask(Role.OPERATOR, "PUT", "/api/v1/files/motions/a.json", {"kind": "none"})
    assert put.status_code == 201
    assert api.ask(Role.VIEWER, "GET", "/api/v1/files/motions/a.json").json() == {"kind": "none"}
    again = api.ask(Role.OPERATOR, "PUT", "/api/v1/files/motions/a.json", {})
    assert again.status_code == 422
    assert again.json()["code"] == "RID-FILE-EXISTS"
    assert api.ask(Role.VIEWER, "PUT", "/api/v1/files/b.json", {}).status_code == 403


@pytest.mark.parametrize("name", ["model.xml", "model.sdf", "load.dat", "load.jbi", "load.src"])
def test_files_that_operations_write_can_be_read(api: Api, name: str) -> None:
    (api.service.folder / name).write_text("content")
    assert api.ask(Role.VIEWER, "GET", f"/api/v1/files/{name}").text == "content"


@pytest.mark.parametrize(
    ("path", "code"),
    [
        ("a.py", "RID-FILE-ENDING"),
        ("runs/x.yaml", "RID-OUTPUT-RUN"),
        ("a/manifest.json", "RID-OUTPUT-RUN"),
        (".hidden.json", "RID-PATH-HIDDEN"),
        ("..%2Fa.json", "RID-PATH-OUTSIDE"),
        ("cell.axes.json", "RID-FILE-AXIS-TEST"),
    ],
)
def test_only_motions_and_models_can_be_uploaded(api: Api, path: str, code: str) -> None:
    answer = api.ask(Role.OPERATOR, "PUT", f"/api/v1/files/{path}", {})
    assert (answer.status_code, answer.json()["code"]) == (422, code)


def test_a_motion_with_a_table_outside_the_folder_is_refused(api: Api) -> None:
    motion = {"kind": "joint_table", "robot": "ir361", "file": "../table.csv"}
    put = api.ask(Role.OPERATOR, "PUT", "/api/v1/files/a.yaml", motion)
    assert put.status_code == 422
    assert put.json()["code"] == "RID-PATH-OUTSIDE"
    assert api.ask(Role.OPERATOR, "GET", "/api/v1/files/a.yaml").status_code == 404


def test_devices_served_by_another_program_keep_their_pace(
    service: CellService, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = service.cell("ir361")
    assert cell.own_pace() == 20.0
    monkeypatch.setattr("rid_daq.service.served_cell.is_served", lambda _cell: True)
    assert cell.own_pace() is None


def test_actions_of_users_are_stored_in_the_audit_log(api: Api) -> None:
    api.lease(note="payload day")
    made = {"name": "CI", "role": "operator"}
    api.ask(Role.ADMINISTRATOR, "POST", "/api/v1/tokens", made)
    answer = api.ask(Role.ADMINISTRATOR, "GET", "/api/v1/audit").json()
    assert [(each["who"], each["what"], each["details"]) for each in answer] == [
        ("administrator", "made a token", "CI, operator"),
        ("operator", "took the cell", "payload day"),
    ]


def test_revoking_a_token_ends_its_lease(api: Api) -> None:
    api.lease()
    tokens = api.ask(Role.ADMINISTRATOR, "GET", "/api/v1/tokens").json()
    (token,) = (each["id"] for each in tokens if each["role"] == "operator")
    gone = api.ask(Role.ADMINISTRATOR, "DELETE", f"/api/v1/tokens/{token}")
    assert gone.status_code == 204
    assert api.ask(Role.VIEWER, "GET", "/api/v1/cells/ir361/lease").json() is None
    answer = api.ask(Role.ADMINISTRATOR, "GET", "/api/v1/audit").json()
    assert [(each["what"], each["cell"], each["details"]) for each in answer[:2]] == [
        ("ended the lease", "ir361", "its token was revoked"),
        ("revoked a token", "", token),
    ]


def test_revoking_an_unknown_token_is_refused(api: Api) -> None:
    answer = api.ask(Role.ADMINISTRATOR, "DELETE", "/api/v1/tokens/none")
    assert (answer.status_code, answer.json()["code"]) == (404, "RID-TOKEN-UNKNOWN")


def test_a_ticket_needs_a_token_even_on_this_computer(api: Api) -> None:
    async def local(scope: Any, receive: Any, send: Any) -> None:
        await api.app({**scope, "state": {"local": True}}, receive, send)

    async def send_request() -> httpx.Response:
        transport = httpx.ASGITransport(local)
        async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
            return await client.post("/api/v1/tickets", json={"path": "/api/v1/runs"})

    answer = asyncio.run(send_request())
    assert (answer.status_code, answer.json()["code"]) == (401, "RID-TICKET-NO-TOKEN")


def test_metrics_have_their_documented_names(api: Api) -> None:
    text = api.ask(Role.VIEWER, "GET", "/metrics").text
    assert 'rid_daq_cell_state{cell="ir361",state="closed"} 1.0' in text
    assert "rid_daq_start_time_seconds" in text


def test_the_api_lists_motions_models_and_runs_of_the_folder(api: Api) -> None:
    motion = "kind: reversed\nrobot: ir361\n"
    (api.service.folder / "back.yaml").write_text(motion)
    folder = RunFolder.create(api.service.runs, "friction")
    folder.write("motion.yaml", motion.encode())
    folder.finish(RunStatus.COMPLETE)
    model = {"kind": "rid-daq estimate", "robot": {"name": "ir361"}}
    folder.file("model.json").write_text(json.dumps(model))

    def answer(request: httpx.Request) -> httpx.Response:
        reply = api.ask(Role.VIEWER, request.method, request.url.path)
        return httpx.Response(reply.status_code, content=reply.content)

    asking = httpx.Client(transport=httpx.MockTransport(answer), base_url="http://cell")
    with ServiceClient(asking) as client:
        found = client.files("ir361")
        (run,) = client.ask("GET", "/runs")
    assert [(each.path, each.kind) for each in found.motions] == [("back.yaml", "reversed")]
    assert [each.path for each in found.models] == [f"runs/{folder.run_id}/model.json"]
    assert run["motion"] == "reversed"
