"""`send`: sends a command's request to the service that owns the cell."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

from config import errors
from config.errors import ConfigError, RidDaqError, ServiceError
from rid_daq.operations.operation import Operation
from rid_daq.requests.request import Request
from rid_daq.service.job_kinds import JobKind
from rid_daq.terminal.clearance import ask_clearance
from rid_daq.terminal.console import Console, Progress

_NAME = re.compile(r"^name:\s*[\"']?([\w.-]+)", re.MULTILINE)


def send(address: str, operation: Operation, request: Request, console: Console) -> None:
    """Send a request to a service, and show the events of the job.

    Args:
        address: Address of the service.
        console: Console that shows the events.

    Raises:
        SystemExit: The command ended with an exit code other than 0.
        RidDaqError: The error of the command; or the service refused the request, or cannot be
            reached.
    """
    from rid_daq.service.client import JobResult, ServiceClient

    kind = JobKind(operation.kind)
    body = request.model_dump(mode="json", exclude_unset=True, exclude=set(operation.owned))
    with ServiceClient.at(address) as service, ExitStack() as stack:
        cells = service.cells()
        name = _cell_name(getattr(request, "cell", None), [each.cell for each in cells])
        cell = next(each for each in cells if each.cell == name)
        shown = _EventDisplay(console)
        if not kind.operation.opens_cell:
            result: JobResult = service.run(name, kind, body, watch=shown)
        else:
            leased = stack.enter_context(service.lease(name, note=f"rid-daq {kind.value}"))
            shown.answer = leased.answer
            cleared = cell.simulated or not kind.operation.moves
            cleared = cleared or ask_clearance(name, getattr(request, "cleared", False), console)
            try:
                result = leased.run(kind, body, cleared=cleared, watch=shown)
            except KeyboardInterrupt:
                service.stop(name)
                raise
            except SystemExit:
                service.stop(name)
                raise
    shown.close()
    _raise_job_failure(result.job.reason, result.ended)


def _raise_job_failure(reason: str, ended: Any) -> None:
    """Raise the error of a failed job; return if the job succeeded.

    Raises:
        RidDaqError: The error that ended the job.
        SystemExit: The exit code of the command, if it is not 0.
    """
    raise_job_error(reason, ended)
    if ended.exit_code:
        raise SystemExit(ended.exit_code)


def raise_job_error(reason: str, ended: Any) -> None:
    """Raise the error that ended a job, if there is one.

    Args:
        reason: Why the job ended, for a job whose process died.
        ended: Its last event; None if its process died.

    Raises:
        RidDaqError: The error.
    """
    if ended is None:
        raise ServiceError(reason, code="RID-JOB-NOT-DONE")
    kind = getattr(errors, ended.error or "", None)
    if isinstance(kind, type) and issubclass(kind, RidDaqError):
        raise kind(ended.message, code=ended.code or "")


def _cell_name(wanted: str | None, names: list[str]) -> str:
    """Return the name of the service's cell that a user means, by its name or by a cell file.

    Raises:
        ConfigError: The service has no such cell.
    """
    if wanted is None:
        return names[0]
    if wanted in names:
        return wanted
    path = Path(wanted)
    named = _NAME.search(path.read_text(encoding="utf-8")) if path.is_file() else None
    if named is not None and named[1] in names:
        return named[1]
    raise ConfigError(
        f"the service has no cell {wanted!r}; it has {', '.join(names)}", code="RID-CELL-UNKNOWN"
    )


class _EventDisplay:
    """Shows the events of a job on a console, and asks the job's questions there.

    Args:
        console: The console.
    """

    def __init__(self, console: Console) -> None:
        self.answer: Callable[[Any, int, str], None] = lambda _job, _question, _text: None
        self._console = console
        self._title = ""
        self._display: AbstractContextManager[Progress] | None = None
        self._progress: Progress | None = None

    def __call__(self, job: Any, event: Any) -> None:
        console = self._console
        if event.kind == "progress":
            if event.title != self._title or self._progress is None:
                self.close()
                self._title = event.title
                self._display = console.progress(event.title, event.total, event.unit)
                self._progress = self._display.__enter__()
            self._progress.update(event.done, event.line)
            return
        self.close()
        match event.kind:
            case "said" | "key_refused":
                console.say(event.text)
            case "state":
                console.announce_state(event.session, event.state, event.text)
            case "judged":
                console.verdict(event.passed, event.text)
            case "result":
                console.result(event.document, event.blocks)
            case "asked":
                self._ask(job, event)

    def close(self) -> None:
        """End the progress display."""
        if self._display is not None:
            self._display.__exit__(None, None, None)
        self._display = self._progress = None

    def _ask(self, job: Any, event: Any) -> None:
        if event.form == "hold":
            raise ConfigError(
                "this job needs a held key: start it on the service's page, or in a terminal at"
                " the cell without --service",
                code="RID-KEY-NEEDED",
            )
        if event.form == "yes_no":
            text = "yes" if self._console.confirm(event.text) else "no"
        else:
            choices = [(each.label, each.text) for each in event.choices]
            text = self._console.ask(event.text, str, choices)
        self.answer(job, event.question, text)
