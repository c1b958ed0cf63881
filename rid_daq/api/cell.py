"""`Cell`: state, jobs and recordings of a cell, through its service."""

from __future__ import annotations

import json
import tempfile
import uuid
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from config.errors import ConfigError, RidDaqError
from config.formats.whole_file import write_new
from rid_daq.api.arguments import ARGUMENT, as_path, require, with_options
from rid_daq.api.compensation import Feedforward
from rid_daq.api.console import ProgressCallback
from rid_daq.api.motion import Motion
from rid_daq.api.recording import Recording, TemporaryFolder
from rid_daq.service.client import JobResult, LeasedCell, ServiceClient
from rid_daq.service.records import CellStatus, Job
from rid_daq.service.remote_jobs import raise_job_error
from rid_daq.terminal.job_events import AnyEvent, ProgressEvent

_ENDINGS: Final = {"motion": ".yaml", "feedforward": ".json"}


@dataclass
class Cell:
    """A cell of a service (`rid-daq serve`), leased during the `with` block.

    >>> with Cell("ir361") as cell:
    ...     cell.run("check")
    ...     recording = cell.record(design("ir361"))

    The service checks every motion, supervises it, and stops it if this program ends. The service
    is not a safety function: the cell's own emergency stop must be within reach.

    Attributes:
        name: The cell's name in the service.
        service: `local` for the only service of this user on this computer; or the path of a
            service's socket; or https://HOST:PORT.
        token: Token for a service at an address; by default the environment variable RID_DAQ_TOKEN.
    """

    name: str
    service: str = "local"
    token: str | None = field(default=None, repr=False)

    def __enter__(self) -> Self:
        require("name", self.name, str)
        require("service", self.service, str)
        if self.token is not None and not require("token", self.token, str).isascii():
            raise ConfigError("token: contains other characters than ASCII", code=ARGUMENT)
        with ExitStack() as stack:
            client = stack.enter_context(ServiceClient.at(self.service, self.token))
            leased = stack.enter_context(client.lease(self.name, note="rid_daq.api"))
            self._open = client, leased
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        del self._open
        self._stack.__exit__(kind, error, trace)

    @property
    def status(self) -> CellStatus:
        """Present state of the cell: state, fault, job, and the reason that prevents a motion."""
        return self._client.cell(self.name)

    def stop(self) -> None:
        """Stop every motion in the cell: a quick stop, then power off.

        Raises:
            ServiceError: The service cannot be reached, or has not answered for 10 s.
            RidDaqError: The service refuses the stop.
        """
        self._client.stop(self.name)

    def run(
        self,
        kind: str,
        request: Mapping[str, object] | None = None,
        *,
        cleared: bool = False,
        progress: ProgressCallback | None = None,
    ) -> dict[str, Any]:
        """Run a job and wait for its end; Ctrl-C stops the robot.

        Args:
            kind: The kind of job, such as check, record, identify or payload_session.
            request: Fields of the request, as in docs/reference/openapi.json.
            cleared: True if no one is in the cell and the emergency stop is within reach; a real
                cell moves only then.
            progress: Called with the step, the amount done and the total.

        Returns:
            The result as a JSON document, as the command prints it with `--json`. A failed verdict
            is a part of the document and raises no error.

        Raises:
            RidDaqError: The job ended with an error, or the service refuses it or cannot be
                reached.
        """
        return self._run_job(kind, request, cleared, progress).document or {}

    def record(
        self,
        motion: Motion,
        *,
        feedforward: Feedforward | None = None,
        label: str = "",
        cleared: bool = False,
        options: Mapping[str, object] | None = None,
        progress: ProgressCallback | None = None,
    ) -> Recording:
        """Run a motion on the cell and return its recording; Ctrl-C stops the robot.

        The run stays in the service's folder, with a copy of the motion and the feedforward. The
        files that this function uploads are deleted at the end; `Recording.notes`, or a note of the
        error, names each file that could not be deleted.

        Args:
            motion: The motion.
            feedforward: Result of `compensate` for this motion, which is applied while it runs.
            label: Label of the run.
            cleared: As for `run`.
            options: Further fields of the request `record`, as in docs/reference/openapi.json.
            progress: Called with the step, the amount done and the total.

        Raises:
            RidDaqError: As for `run`; SafetyStop if the motion was stopped.
        """
        files: dict[str, Motion | Feedforward] = {"motion": require("motion", motion, Motion)}
        if feedforward is not None:
            files["feedforward"] = require("feedforward", feedforward, Feedforward)
        names = {kind: f"{kind}-{uuid.uuid4().hex[:12]}{_ENDINGS[kind]}" for kind in files}
        request = {**with_options(names, options), **({"label": label} if label else {})}
        uploaded: dict[str, str] = {}
        try:
            with tempfile.TemporaryDirectory(prefix="rid-daq-") as folder:
                for kind, name in names.items():
                    files[kind].save(Path(folder) / name)
                    uploaded[name] = self._client.put_file(Path(folder) / name, name)
            run = self._run_job("record", request, cleared, progress).job.run or ""
        except BaseException as error:
            for note in self._delete_uploaded(uploaded):
                error.add_note(note)
            raise
        notes = self._delete_uploaded(uploaded)
        recording = self.recording(run)
        return replace(recording, notes=(*recording.notes, *notes))

    def _delete_uploaded(self, versions: Mapping[str, str]) -> list[str]:
        """Delete uploaded files, and return a note on each that remains in the service's folder."""
        notes = []
        for name, version in versions.items():
            try:
                self._client.delete_file(name, version)
            except RidDaqError as error:
                notes.append(f"{name} remains in the service's folder: {error}")
        return notes

    def recording(self, run: str) -> Recording:
        """Return the recording of a run of the service.

        Args:
            run: Id or label of the run, or `latest`.

        Raises:
            RidDaqError: The run does not exist or has no recording, or the service cannot be
                reached.
        """
        manifest = self._client.ask("GET", f"/runs/{run}/manifest")
        kept = TemporaryFolder()
        place = kept.path / str(manifest["run_id"])
        place.mkdir()
        for name in manifest["files"]:
            (place / name).write_bytes(self._client.get_run_file(run, name))
        (place / MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
        return Recording.from_run(RunFolder.open(place), kept)

    def download(self, name: str, path: str | Path) -> None:
        """Save a file of the service's folder, such as the velocity loops that a job wrote.

        Args:
            name: Name in the service's folder, such as the `output` of the job.
            path: The new file.

        Raises:
            RidDaqError: The service cannot be reached or has no such file (RID-FILE-UNKNOWN), or
                the new file exists already (RID-FILE-EXISTS) or cannot be written.
        """
        write_new(as_path("path", path), self._client.get_file(name))

    @property
    def _connection(self) -> tuple[ServiceClient, LeasedCell]:
        try:
            return self._open
        except AttributeError:
            raise ConfigError(
                f"cell {self.name} is not leased: use it in a `with`", code="RID-API-ARGUMENT"
            ) from None

    @property
    def _client(self) -> ServiceClient:
        return self._connection[0]

    def _run_job(
        self,
        kind: str,
        request: Mapping[str, object] | None,
        cleared: bool,
        progress: ProgressCallback | None,
    ) -> JobResult:
        _, leased = self._connection

        def watch(_job: Job, event: AnyEvent) -> None:
            if progress is not None and isinstance(event, ProgressEvent):
                step = f"{event.title}: {event.line}" if event.line else event.title
                progress(step, event.done, event.total)

        try:
            result = leased.run(kind, request, cleared=cleared, watch=watch)
        except KeyboardInterrupt:
            self.stop()
            raise
        raise_job_error(result.job.reason, result.ended)
        return result
