"""With TLS the front process encrypts and forwards requests; it ends with the service."""

from __future__ import annotations

import json
import socket
import ssl
from contextlib import closing
from pathlib import Path

import httpx
import pytest
from websockets.sync.client import connect

from rid_daq.service.sockets import socket_path_of
from tests.rid_daq.service.conftest import serving
from tests.rid_daq.service.moving import front_process, served_port, until

pytestmark = pytest.mark.alone
STOPPING = {"X-Rid-Daq": "stop"}


def test_the_front_process_forwards_everything_over_tls(
    tmp_path: Path,
    certificate: Path,
) -> None:
    with serving(tmp_path, "--certificate", str(certificate)) as served:
        with served.client as client:
            token = client.ask("POST", "/tokens", {"name": "operator", "role": "operator"})
            shown = {"Authorization": f"Bearer {token['secret']}"}
        trust = ssl.create_default_context(cafile=str(certificate))
        trust.check_hostname = False
        port = served_port(served)
        base = f"https://127.0.0.1:{port}"
        with httpx.Client(verify=trust, base_url=base, headers=shown, timeout=60.0) as http:
            assert http.get("/api/v1/health").json()["status"] == "ok"
            document = http.get("/api/v1/openapi.json")
            assert "paths" in document.json(), (
                "an answer that is larger than one buffer must arrive complete"
            )
            content = json.dumps({"numbers": list(range(500_000))})
            put = {"x-rid-daq": "1", "content-type": "application/json"}
            answer = http.put("/api/v1/files/large.json", content=content, headers=put)
            assert answer.status_code == 201, answer.text
            assert http.get("/api/v1/files/large.json").text == content
            assert http.post("/api/v1/stop", headers=STOPPING).status_code == 202
        address = f"wss://127.0.0.1:{port}/api/v1"
        with connect(f"{address}/ws", ssl=trust, additional_headers=shown) as line:
            assert json.loads(line.recv())["type"] == "cell"
        with connect(f"{address}/stop-line", ssl=trust) as line:
            line.send('{"stop": "*", "number": 5}')
            while (message := json.loads(line.recv()))["type"] != "stopped":
                pass
            assert message["number"] == 5
        with closing(socket.create_connection(("127.0.0.1", port), timeout=60.0)) as plain:
            plain.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
            assert b"200" not in plain.recv(4096)
    assert "Traceback" not in (tmp_path / "serve.log").read_text()


def test_the_front_process_ends_with_the_service(tmp_path: Path) -> None:
    with serving(tmp_path) as served:
        until(lambda: front_process(served) is not None)
        front, port = front_process(served), served_port(served)
        assert served.end() == 0
        until(lambda: not Path(f"/proc/{front}").exists())
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port), timeout=60.0)
        assert not socket_path_of(tmp_path).exists()
