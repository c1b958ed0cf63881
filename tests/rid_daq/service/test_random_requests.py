"""Random documents of a client are refused or become a job, and cause no internal error."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Role
from rid_daq.service.service import CellService
from tests.rid_daq.service.conftest import Worker
from tests.rid_daq.service.test_api import Api
from tests.rid_daq.worker.test_request_ranges import SCHEMAS, odd_values, values_of

pytestmark = pytest.mark.promise("ranges-everywhere")


@pytest.mark.parametrize("kind", JobKind)
def test_no_random_request_causes_an_internal_error(
    service: CellService, worker: Worker, kind: JobKind
) -> None:
    api = Api(service)
    key = api.lease()
    folder = service.folder

    def begin(body: Any) -> httpx.Response:
        headers = {
            "authorization": f"Bearer {api.secrets[Role.OPERATOR]}",
            "content-type": "application/json",
            "x-rid-daq-lease": key,
        }

        async def send_requests() -> httpx.Response:
            transport = httpx.ASGITransport(api.app, client=("192.0.2.7", 4711))
            async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
                content = json.dumps(body).encode()  # with NaN and Infinity, as Python writes them
                path = "/api/v1/cells/ir361/jobs"
                return await client.post(path, content=content, headers=headers)

        return asyncio.run(send_requests())

    @settings(
        max_examples=15,
        deadline=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
    @given(values_of(SCHEMAS[kind], SCHEMAS[kind]) | st.dictionaries(st.text(), odd_values()))
    def look(request: Any) -> None:
        before = sorted(folder.parent.iterdir())
        answer = begin({"kind": kind.value, "request": request})
        assert answer.status_code < 500, answer.text
        assert sorted(folder.parent.iterdir()) == before
        if answer.status_code < 300:
            json.dumps(request, allow_nan=False)

    look()


@pytest.mark.parametrize(
    "body",
    [
        b'{"kind": "check", "request": Infinity}',
        b'{"kind": "check", "request": [NaN]}',
        b'{"kind": NaN}',
        b'{"kind": "\\ud800"}',
        b'{"kind": "record", "request": {"motion": "\\ud800"}}',
        b'{"kind": "record", "request": {"motion": "m", "\\ud800": 1}}',
        b"[" * 5000,
    ],
)
def test_a_body_that_is_not_valid_json_text_is_refused(service: CellService, body: bytes) -> None:
    api = Api(service)
    headers = {
        "authorization": f"Bearer {api.secrets[Role.OPERATOR]}",
        "content-type": "application/json",
    }

    async def send_requests() -> httpx.Response:
        transport = httpx.ASGITransport(api.app, client=("192.0.2.7", 4711))
        async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
            return await client.post("/api/v1/cells/ir361/jobs", content=body, headers=headers)

    answer = asyncio.run(send_requests())
    assert 400 <= answer.status_code < 500
    json.loads(answer.text)
