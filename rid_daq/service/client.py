"""`ServiceClient`: a service from a program: cells, a lease as a `with`, jobs as calls that wait.

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
from rid_daq.service.refusals import refusal_of
from rid_daq.service.sockets import is_this_computer, local_sockets
from rid_daq.terminal.job_events import EVENT, AnyEvent, Ended, Resulted

LOOK_S: Final = 0.1
LEASE_S: Final = 15.0
LEASE_HEADER: Final = "x-rid-daq-lease"
TOKEN_VARIABLE: Final = "RID_DAQ_TOKEN"
_REACH_S: Final = 10.0
_PATIENCE_S: Final = 60.0  # of a service whose computer is busy: what it was asked is not undone
_STOP_PATIENCE_S: Final = 10.0  # who stops must know soon whether it was heard

Watch = Callable[[Job, AnyEvent], None]
"""Told what a job says, as it says it."""


@dataclass(frozen=True)
class JobResult:
    """A job that is over.

    Attributes:
        job: How it ended.
        document: Its result for programs, as the command's `--json`; None where it has none.
        ended: Its own last word; None where its process died.
    """

    job: Job
    document: dict[str, Any] | None
    ended: Ended | None

    def require_done(self) -> Self:
        """Return this result where the job ended well.

        Raises:
            ServiceError: It did not.
        """
        if self.job.state is not JobState.DONE:
            raise ServiceError(
                f"job {self.job.id} ({self.job.kind.value}) is {self.job.state.value}:"
                f" {self.job.reason}",
                code="RID-JOB-NOT-DONE",
            )
        return self


class ServiceClient:
    """A service, asked by a program.

    Args:
        http: Leads there, and shows a token where one is needed.
    """

    def __init__(self, http: httpx.Client) -> None:
        self._http = http

    @classmethod
    def at(cls, address: str, token: str | None = None) -> Self:
        """Return the client of a service.

        Args:
            address: `local` for the only service of this user on this computer, the path of its
                socket, or its address as https://HOST:PORT.
            token: What it wants to see; the environment variable RID_DAQ_TOKEN if not given.

        Raises:
            ConfigError: It is no address, or there is not exactly one local service.
        """
        headers = {"x-rid-daq": "client", "content-type": "application/json"}
        secret = token or os.environ.get(TOKEN_VARIABLE, "")
        if secret:
            headers["authorization"] = f"Bearer {secret}"
        if address.startswith(("http://", "https://")):
            secure = address.startswith("https://")
            if not (secure or is_this_computer(address)):
                raise ConfigError(
                    f"--service {address}: would send the token in the clear: give https://, or an"
                    " address of this computer",
                    code="RID-SERVICE-PLAIN",
                )
            http = httpx.Client(base_url=address, headers=headers, trust_env=secure)
            http.timeout = _patience()
            return cls(http)
        transport = httpx.HTTPTransport(uds=str(_socket(address)))
        return cls(
            httpx.Client(
                base_url="http://localhost",
                headers=headers,
                transport=transport,
                timeout=_patience(),
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
        """Return what the service answers, as JSON has it.

        Raises:
            RidDaqError: It refused, by the error that it names.
            ServiceError: It cannot be reached, or has not answered for a minute.
        """
        headers = {} if lease is None else {LEASE_HEADER: lease}
        answer = self._send(
            self._http.build_request(method, _api(path), json=body, headers=headers)
        )
        return answer.json() if answer.content else None

    def cells(self) -> list[CellStatus]:
        """Return every cell of the service as it is now."""
        return [CellStatus.model_validate(each) for each in self.ask("GET", "/cells")]

    def cell(self, name: str) -> CellStatus:
        """Return a cell as it is now."""
        return CellStatus.model_validate(self.ask("GET", f"/cells/{quote(name)}"))

    def files(self, cell: str) -> FilesOfCell:
        """Return what lies in the service's folder for a cell's robot, the newest first."""
        return FilesOfCell.model_validate(self.ask("GET", f"/cells/{quote(cell)}/files"))

    def job(self, job_id: str) -> Job:
        """Return a job as it is now."""
        return Job.model_validate(self.ask("GET", f"/jobs/{quote(job_id)}"))

    def stop(self, cell: str) -> None:
        """Stop what moves in a cell.

        Raises:
            ServiceError: As `ask`, but after 10 s without an answer.
        """
        path = _api(f"/cells/{quote(cell)}/stop")
        self._send(self._http.build_request("POST", path, timeout=_patience(_STOP_PATIENCE_S)))

    def put_file(self, path: Path, name: str) -> None:
        """Put a local file into the service's folder."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise ConfigError(
                f"{path}: cannot be read: {error.strerror}", code="RID-FILE-READ"
            ) from None
        self._send(self._http.build_request("PUT", _api(f"/files/{quote(name)}"), content=content))

    def get_run_file(self, run: str, name: str) -> bytes:
        """Return a file of a run."""
        path = _api(f"/runs/{quote(run)}/files/{quote(name)}")
        return self._send(self._http.build_request("GET", path)).content

    def _send(self, request: httpx.Request) -> httpx.Response:
        """Return the answer of a service that did not refuse."""
        try:
            answer = self._http.send(request)
        except httpx.ReadTimeout:
            waited_s = request.extensions["timeout"]["read"]
            raise ServiceError(
                f"the service has not answered for {waited_s:g} s: it hangs, or its computer is too"
                " busy; what it was asked may still be done",
                code="RID-SERVICE-UNREACHABLE",
            ) from None
        except httpx.HTTPError as error:
            raise ServiceError(
                f"the service cannot be reached: {error}", code="RID-SERVICE-UNREACHABLE"
            ) from None
        if not answer.is_success:
            raise refusal_of(answer)
        return answer

    @contextmanager
    def lease(self, cell: str, note: str = "", seconds: float = LEASE_S) -> Iterator[LeasedCell]:
        """Have a cell for as long as the `with` lasts; it is renewed meanwhile.

        Raises:
            LockedError: Somebody else has it.
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
                    return  # lost: the next job is refused, by its words
                except ServiceError:
                    continue

        beating = threading.Thread(target=renew, name="lease", daemon=True)
        beating.start()
        try:
            yield LeasedCell(self, lease)
        finally:
            over.set()
            beating.join()
            with contextlib.suppress(LockedError, ServiceError):  # it runs out by itself
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
        """Have a job done and wait for its end.

        Args:
            cell: The cell's name.
            kind: The kind of job.
            request: What is asked for, as `/api/v1/requests` has it.
            lease: The key of the lease; a job that opens the cell needs it.
            cleared: Whether nobody is in the cell and the emergency stop is at hand.
            on_lost_client: What happens to a motion where this program is gone.
            watch: Told what the job says.

        Raises:
            RidDaqError: It was refused.
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
        """Wait for the end of a job that was begun."""
        known = 0
        document: dict[str, Any] | None = None
        ended: Ended | None = None
        while True:
            job = self.job(job.id)
            for told in self.ask("GET", f"/jobs/{job.id}/events?after={known}"):
                known += 1
                event = EVENT.validate_python(told)
                if isinstance(event, Resulted):
                    document = event.document
                if isinstance(event, Ended):
                    ended = event
                watch(job, event)
            if job.state.is_over:
                return JobResult(job, document, ended)
            time.sleep(LOOK_S)


@dataclass(frozen=True)
class LeasedCell:
    """A cell that this program has."""

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
        """Have a job done on the cell and wait for its end; as `ServiceClient.run`."""
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
        """Answer what a job asks."""
        told = {"question": question, "text": text}
        self.service.ask("POST", f"/jobs/{job.id}/answer", told, self.lease.key)


def _api(path: str) -> str:
    return f"/api/v1{path}"


def _patience(answer_s: float | None = None) -> httpx.Timeout:
    """Return how long to wait for a connection, and for an answer (`_PATIENCE_S` if not said)."""
    return httpx.Timeout(_PATIENCE_S if answer_s is None else answer_s, connect=_REACH_S)


def _socket(address: str) -> Path:
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
            "no service of yours runs on this computer: `rid-daq serve CELL` is one",
            code="RID-SERVICE-UNREACHABLE",
        )
    names = ", ".join(map(str, found))
    raise ConfigError(
        f"several services run on this computer: name the socket of one: {names}",
        code="RID-SERVICE-ADDRESS",
    )
