"""`Editing`: a service of a cell with files on disk, and a client of each role."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx

from config.formats.approved_files import sha256_of
from config.load import load_cell
from rid_daq.service.api.app import make_api
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.records import Identity, Role
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService


def write_cell(folder: Path) -> None:
    """Write the files of the bundled cell ir361, with its robot file as `arm.yaml`."""
    files = load_cell("ir361").files
    cell = files["cell.yaml"].replace(b"robot: ir361", b"robot: arm.yaml")
    (folder / "cell.yaml").write_bytes(cell)
    (folder / "arm.yaml").write_bytes(files["robot.yaml"])


class Editing:
    """A service of a cell with files on disk, and a client of each role."""

    def __init__(self, folder: Path) -> None:
        write_cell(folder)
        self.folder = folder
        self.service = CellService(folder, [ServedCell(str(folder / "cell.yaml"), 20.0)])
        self.app = make_api(self.service, Authenticator(self.service.tokens, 0, secure=False))
        self.secrets = {
            role: self.service.tokens.add(role.value, role, person=True)[1] for role in Role
        }

    def ask(
        self, role: Role, method: str, path: str, body: str = "", **headers: str
    ) -> httpx.Response:
        """Send a request for a file."""
        return self.ask_api(role, method, f"files/{path}", body, **headers)

    def ask_api(
        self, role: Role, method: str, path: str, body: str = "", **headers: str
    ) -> httpx.Response:
        """Send a request for any path of the API."""
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        headers["authorization"] = f"Bearer {self.secrets[role]}"

        async def send_request() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, client=("192.0.2.7", 4711))
            async with httpx.AsyncClient(transport=transport, base_url="http://cell") as client:
                url = f"/api/v1/{path}"
                return await client.request(method, url, content=body, headers=headers)

        return asyncio.run(send_request())

    def save(self, role: Role, name: str, body: str, version: str, **more: str) -> httpx.Response:
        query = more.pop("query", "")
        return self.ask(role, "PUT", name + query, body, if_match=f'"{version}"', **more)

    def version(self, name: str) -> str:
        return sha256_of((self.folder / name).read_bytes())

    def text(self, name: str) -> str:
        return (self.folder / name).read_text()

    def hold(self) -> None:
        """Give another client the lease of the cell."""
        other = Identity(name="Bert", role=Role.OPERATOR, person=True, token="Bert")
        self.service.leases.take("ir361", other, "weighing", 60.0)
