"""`ServiceClient`: access to a service from a program.

A lease is a context manager; a job is a call that waits for its end.

>>> with ServiceClient.at("local") as service, service.lease("ir361", note="CI") as cell:
...     cell.run("check").require_done()
...     recorded = cell.run("record", {"motion": "motion.yaml"}).require_done()
...     service.run("ir361", "identify", {"names": [recorded.job.run]})
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self
from urllib.parse import quote

import httpx

from config.errors import ConfigError, LockedError, ServiceError
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import CellStatus, FilesOfCell, HeldLease, Job, JobState, OnLostClient
from rid_daq.service.refusals import error_from_answer
from rid_daq.service.sockets import is_this_computer, local_sockets
from rid_daq.terminal.job_events import EVENT, AnyEvent, EndEvent, ResultEvent

LOOK_S: Final = 0.1
LEASE_S: Final = 15.0
LEASE_HEADER: Final = "x-rid-daq-lease"
TOKEN_VARIABLE: Final = "RID_DAQ_TOKEN"
_REACH_S: Final = 10.0
_PATIENCE_S: Final = (
    60.0  # an overloaded computer answers late; a timeout does not cancel the request
)
_IDEMPOTENT: Final = ("GET", "PUT", "DELETE")
_STOP_PATIENCE_S: Final = 10.0  # the user must know soon if the stop has arrived

Watch = Callable[[Job, AnyEvent], None]
"""Function that is called with every event of a job, as soon as it is read."""


@dataclass(frozen=True)
class JobResult:
    """Result of a job that has ended.

    Attributes:
        job: The job with its final state.
        document: Result for programs, as `--json` of the same command prints it; None if the job
            has no result.
        ended: Last event of the job; None if its process died.
    """

    job: Job
    document: dict[str, Any] | None
    ended: EndEvent | None

    def require_done(self) -> Self:
        """Return this result if the job succeeded.

        Raises:
            ServiceError: The job failed, was stopped or was interrupted.
        """
        if self.job.state is not JobState.DONE:
            raise ServiceError(
                f"job {self.job.id} ({self.job.kind.value}) is {self.job.state.value}:"
                f" {self.job.reason}",
                code="RID-JOB-NOT-DONE",
            )
        return self


class ServiceClient:
    """Client of a service, for programs.

    Args:
        http: HTTP client with the service's address, and its token if one is required.
    """

    def __init__(self, http: httpx.Client) -> None:
        self._http = http

    @classmethod
    def at(cls, address: str, token: str | None = None) -> Self:
        """Return the client of a service.

        Args:
            address: `local` for the only service of this user on this computer, the path of its
                socket, or its address as https://HOST:PORT.
            token: Token for the service (default: the environment variable RID_DAQ_TOKEN).

        Raises:
            ConfigError: The address is invalid or would send the token without encryption; or no
                service or several services of this user run on this computer.
        """
        headers = {"x-rid-daq": "client", "content-type": "application/json"}
        secret = token or os.environ.get(TOKEN_VARIABLE, "")
        if secret:
            headers["authorization"] = f"Bearer {secret}"
        if address.startswith(("http://", "https://")):
            secure = address.startswith("https://")
            if not (secure or is_this_computer(address)):
                raise ConfigError(
                    f"--service {address}: the token would be sent without encryption: give"
                    " https://, or an address of this computer",
                    code="RID-SERVICE-PLAIN",
                )
            http = httpx.Client(base_url=address, headers=headers, trust_env=secure)
            http.timeout = _timeout()
            return cls(http)
        transport = httpx.HTTPTransport(uds=str(_find_socket(address)))
        return cls(
            httpx.Client(
                base_url="http://localhost",
                headers=headers,
                transport=transport,
                timeout=_timeout(),
            )
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self._http.close()

    def ask(self, method: str, path: str, body: object = None, lease: str | None = None) -> Any:
        """Send a request and return the JSON document of the answer.

        Raises:
            RidDaqError: The service refused the request; its answer names the class of this error.
            ServiceError: The service cannot be reached, or has not answered for a minute.
        """
        headers = {} if lease is None else {LEASE_HEADER: lease}
        answer = self._send_checked(
            self._http.build_request(method, _api_path(path), json=body, headers=headers)
        )
        return answer.json() if answer.content else None

    def cells(self) -> list[CellStatus]:
        """Return the present status of every cell."""
        return [CellStatus.model_validate(each) for each in self.ask("GET", "/cells")]

    def cell(self, name: str) -> CellStatus:
        """Return the present status of a cell."""
        return CellStatus.model_validate(self.ask("GET", f"/cells/{quote(name)}"))

    def files(self, cell: str) -> FilesOfCell:
        """Return the files in the service's folder for a cell's robot, the newest first."""
        return FilesOfCell.model_validate(self.ask("GET", f"/cells/{quote(cell)}/files"))

    def job(self, job_id: str) -> Job:
        """Return the present state of a job."""
        return Job.model_validate(self.ask("GET", f"/jobs/{quote(job_id)}"))

    def stop(self, cell: str) -> None:
        """Stop the motion in a cell.

        Raises:
            ServiceError: The service cannot be reached, or has not answered for 10 s.
            RidDaqError: The service refused the stop.
        """
        path = _api_path(f"/cells/{quote(cell)}/stop")
        request = self._http.build_request("POST", path, timeout=_timeout(_STOP_PATIENCE_S))
        self._send_checked(request, repeatable=True)

    def put_file(self, path: Path, name: str) -> str:
        """Upload a local file into the service's folder, and return its version.

        Raises:
            ConfigError: The local file cannot be read.
            RidDaqError: As raised by `ask`.
        """
        try:
            content = path.read_bytes()
        except OSError as error:
            raise ConfigError(
                f"{path}: cannot be read: {error.strerror}", code="RID-FILE-READ"
            ) from None
        answer = self._send_checked(
            self._http.build_request("PUT", _api_path(f"/files/{quote(name)}"), content=content)
        )
        return str(answer.json()["version"])

    def delete_file(self, name: str, version: str) -> None:
        """Delete a file of the service's folder; the service refuses if it has another version."""
        path, headers = _api_path(f"/files/{quote(name)}"), {"if-match": f'"{version}"'}
        self._send_checked(self._http.build_request("DELETE", path, headers=headers))

    def get_file(self, name: str) -> bytes:
        """Return a file of the service's folder."""
        path = _api_path(f"/files/{quote(name)}")
        return self._send_checked(self._http.build_request("GET", path)).content

    def get_run_file(self, run: str, name: str) -> bytes:
        """Return a file of a run."""
        path = _api_path(f"/runs/{quote(run)}/files/{quote(name)}")
        return self._send_checked(self._http.build_request("GET", path)).content

    def _send_checked(self, request: httpx.Request, *, repeatable: bool = False) -> httpx.Response:
        """Send a request and return the answer; raise the error of a refusal.

        A request with an idempotent method (RFC 9110, 9.2.2), or one that is `repeatable`, is sent
        once more if the service closes the connection without an answer. The service does so if
        this program sends too late, as on an overloaded computer.
        """
        repeatable = repeatable or request.method in _IDEMPOTENT
        try:
            try:
                answer = self._http.send(request)
            except (httpx.RemoteProtocolError, httpx.ReadError, httpx.WriteError):
                if not repeatable:
                    raise
                answer = self._http.send(request)
        except httpx.ReadTimeout:
            waited_s = request.extensions["timeout"]["read"]
            raise ServiceError(
                f"the service has not answered for {waited_s:g} s: it hangs, or its computer is"
                " overloaded; the request may still be executed",
                code="RID-SERVICE-UNREACHABLE",
            ) from None
        except httpx.HTTPError as error:
            raise ServiceError(
                f"the service cannot be reached: {error}", code="RID-SERVICE-UNREACHABLE"
            ) from None
        if not answer.is_success:
            raise error_from_answer(answer)
        return answer

    @contextmanager
    def lease(self, cell: str, note: str = "", seconds: float = LEASE_S) -> Iterator[LeasedCell]:
        """Hold the lease of a cell inside the `with` block; a thread renews it.

        Raises:
            LockedError: Another client holds the cell.
            RidDaqError: As raised by `ask`.
        """
        wanted = {"note": note, "seconds": seconds}
        lease = HeldLease.model_validate(self.ask("POST", f"/cells/{quote(cell)}/lease", wanted))
        over = threading.Event()

        def renew() -> None:
            while not over.wait(seconds / 4.0):
                try:
                    path = f"/cells/{quote(cell)}/lease"
                    self.ask("PUT", path, {"seconds": seconds}, lease.key)
                except LockedError:
                    return  # the lease is lost: the next job is refused with the reason
                except ServiceError:
                    continue

        beating = threading.Thread(target=renew, name="lease", daemon=True)
        beating.start()
        try:
            yield LeasedCell(self, lease)
        finally:
            over.set()
            beating.join()
            with contextlib.suppress(LockedError, ServiceError):  # the lease expires by itself
                self.ask("DELETE", f"/cells/{quote(cell)}/lease", None, lease.key)

    def run(
        self,
        cell: str,
        kind: str | JobKind,
        request: Mapping[str, object] | None = None,
        *,
        lease: str | None = None,
        cleared: bool = False,
        on_lost_client: OnLostClient = "stop",
        watch: Watch = lambda _job, _event: None,
    ) -> JobResult:
        """Start a job and wait for its end.

        Args:
            cell: The cell's name.
            kind: The kind of job.
            request: Request in the form of the schema at `/api/v1/requests`.
            lease: Key of the cell's lease; a job that uses the cell's bus requires it.
            cleared: True if no one is in the cell and the emergency stop is within reach.
            on_lost_client: Action on a motion if the connection to this program is lost.
            watch: Function that is called with every event of the job.

        Raises:
            RidDaqError: The service refused the job.
        """
        wanted = {
            "kind": JobKind(kind).value,
            "request": request or {},
            "cleared": cleared,
            "on_lost_client": on_lost_client,
        }
        begun = self.ask("POST", f"/cells/{quote(cell)}/jobs", wanted, lease)
        return self.follow(Job.model_validate(begun), watch)

    def follow(self, job: Job, watch: Watch = lambda _job, _event: None) -> JobResult:
        """Wait for the end of a job that has been started, and return its result."""
        known = 0
        document: dict[str, Any] | None = None
        ended: EndEvent | None = None
        while True:
            job = self.job(job.id)
            for entry in self.ask("GET", f"/jobs/{job.id}/events?after={known}"):
                known += 1
                event = EVENT.validate_python(entry)
                if isinstance(event, ResultEvent):
                    document = event.document
                if isinstance(event, EndEvent):
                    ended = event
                watch(job, event)
            if job.state.is_over:
                return JobResult(job, document, ended)
            time.sleep(LOOK_S)


@dataclass(frozen=True)
class LeasedCell:
    """A cell whose lease this program holds."""

    service: ServiceClient
    lease: HeldLease

    def run(
        self,
        kind: str | JobKind,
        request: Mapping[str, object] | None = None,
        *,
        cleared: bool = False,
        on_lost_client: OnLostClient = "stop",
        watch: Watch = lambda _job, _event: None,
    ) -> JobResult:
        """Start a job on the cell and wait for its end; see `ServiceClient.run` for arguments."""
        return self.service.run(
            self.lease.cell,
            kind,
            request,
            lease=self.lease.key,
            cleared=cleared,
            on_lost_client=on_lost_client,
            watch=watch,
        )

    def answer(self, job: Job, question: int, text: str) -> None:
        """Send an answer to the question of a job."""
        document = {"question": question, "text": text}
        self.service.ask("POST", f"/jobs/{job.id}/answer", document, self.lease.key)


def _api_path(path: str) -> str:
    return f"/api/v1{path}"


def _timeout(answer_s: float | None = None) -> httpx.Timeout:
    """Return the timeouts of a connection and of an answer (default: `_PATIENCE_S`)."""
    return httpx.Timeout(_PATIENCE_S if answer_s is None else answer_s, connect=_REACH_S)


def _find_socket(address: str) -> Path:
    if address != "local":
        path = Path(address)
        if not path.is_socket():
            raise ConfigError(
                f"--service {address}: give local, the path of a service's socket, or"
                " https://HOST:PORT",
                code="RID-SERVICE-ADDRESS",
            )
        return path
    found = local_sockets()
    if len(found) == 1:
        return found[0]
    if not found:
        raise ConfigError(
            "you have no running service on this computer: start one with `rid-daq serve CELL`",
            code="RID-SERVICE-UNREACHABLE",
        )
    names = ", ".join(map(str, found))
    raise ConfigError(
        f"several services run on this computer: give the socket of one service: {names}",
        code="RID-SERVICE-ADDRESS",
    )
