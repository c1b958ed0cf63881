"""`runs`: list the runs, and check on request that their files are unchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.errors import ConfigError, RecordingError
from rid_daq.blocks.block import AnyBlock, Cells, Table, Text, Verdict, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from acquisition.runs.folder import RunFolder

_NOT_SHOWN: Final = ("verdict", "headline", "session", "stop", "used_model", "used_runs")
"""Facts that the column `facts` leaves out."""


class RunsRequest(Request):
    """List the runs, oldest first; with --verify, check that no file was changed.

    With --verify, files that do not belong to a run are named, but are not a problem; the exit code
    is 7 if a file was changed or is missing, if a manifest cannot be read or lists no files, or if
    a file that commands read, such as the recording, is not in it.
    """

    verify: Annotated[bool, Field(description="Compare every file with the run's manifest.")] = (
        False
    )
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class ListedRun:
    """One listed run; `problems` and `strays` are None if the run's files were not compared."""

    run: str
    label: str
    kind: str
    status: str
    created_utc: str
    folder: str
    facts: Mapping[str, object]
    problems: list[str] | None
    strays: list[str] | None

    @property
    def other_facts(self) -> Iterator[str]:
        """Name and value of each fact that is neither in `_NOT_SHOWN` nor empty."""
        for name, value in self.facts.items():
            if name not in _NOT_SHOWN and value not in (None, []):
                yield f"{name} {value}"

    def document(self) -> dict[str, object]:
        """Return the fields; without `problems` and `strays` if the files were not compared."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class RunsResult:
    """Runs of a folder.

    Attributes:
        listed: The runs, oldest first.
        damaged: Name and problem of every run without a readable manifest of its own.
        unlisted: Names of folders with a manifest that are links, or whose name is no run id.
    """

    request: RunsRequest
    listed: tuple[ListedRun, ...]
    damaged: tuple[tuple[str, str], ...]
    unlisted: tuple[str, ...]

    @property
    def problems(self) -> tuple[tuple[str, str], ...]:
        """Run and problem of each changed, missing or unreadable file; empty without --verify."""
        found = tuple((each.run, text) for each in self.listed for text in each.problems or ())
        return found + self.damaged if self.request.verify else ()

    @property
    def failure(self) -> RecordingError | None:
        """Error with all problems; None without problems."""
        if not self.problems:
            return None
        lines = "\n".join(f"  {run}: {problem}" for run, problem in self.problems)
        text = f"problems in the run folders: {len(self.problems)}\n{lines}"
        return RecordingError(text, code="RID-RUN-DAMAGED")

    @property
    def exit_code(self) -> int:
        """Exit code 7 if there are `problems`."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.STORAGE if self.problems else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return the runs, and the problems of damaged runs."""
        return {
            "runs": [each.document() for each in self.listed],
            "damaged": [problem for _, problem in self.damaged],
            "unlisted": list(self.unlisted),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the table, files that belong to no run, and the verdict."""
        if self.listed:
            yield self._table()
        elif not self.damaged:
            hint = "`rid-daq demo` and `rid-daq record` make runs."
            yield Text(text=f"{self.request.runs}: the folder contains no runs yet. {hint}")
        for each in self.listed:
            if each.strays:
                names = ", ".join(each.strays)
                yield Text(text=f"note: {each.run}: files that do not belong to the run: {names}")
        if self.unlisted:
            names = ", ".join(self.unlisted)
            yield Text(
                text=f"note: runs in these folders are not listed, because they are links or their"
                f" name is not a run id: {names}"
            )
        if self.request.verify:
            count = len(self.listed) + len(self.damaged)
            whole = count - len({run for run, _ in self.problems})
            text = f"Unchanged runs: {whole} of {count}."
            yield Verdict(passed=not self.problems, text=text)
            return
        for _, problem in self.damaged:
            yield Verdict(passed=False, text=f"damaged: {problem}")

    def _table(self) -> Table:
        return table(
            self.listed,
            Cells("run", lambda run: run.run),
            Cells("created (UTC)", lambda run: run.created_utc[:16].replace("T", " ")),
            Cells("kind", lambda run: run.kind),
            Cells("status", lambda run: run.status),
            Cells("verdict", lambda run: str(run.facts.get("verdict", ""))),
            Cells("label", lambda run: run.label),
            Cells("facts", lambda run: ", ".join(run.other_facts), is_optional=True),
            failed=lambda run: run.status != "complete" or bool(run.problems),
        )


def run(request: RunsRequest, _context: Context) -> RunsResult:
    """List the runs, and compare their files if requested."""
    from acquisition.runs.catalogue import list_damaged_runs, list_runs, unlisted_folders

    listed = tuple(
        ListedRun(
            run=manifest.run_id,
            label=manifest.label,
            kind=manifest.kind,
            status=manifest.status,
            created_utc=manifest.created_utc,
            folder=str(found.path),
            facts=manifest.facts,
            problems=_problems(found) if request.verify else None,
            strays=list(found.strays()) if request.verify else None,
        )
        for found, manifest in list_runs(request.runs)
    )
    damaged = tuple(
        (each.run_id, str(problem)) for each, problem in list_damaged_runs(request.runs)
    )
    if request.verify and not listed and not damaged:
        raise ConfigError(
            f"{request.runs}: the folder contains no runs, so nothing can be verified",
            code="RID-RUN-UNKNOWN",
        )
    return RunsResult(request, listed, damaged, unlisted_folders(request.runs))


def _problems(found: RunFolder) -> list[str]:
    from rid_daq.runs.run_data import READ

    return list(found.verify(READ))


OPERATION: Final = Operation(
    name="runs",
    label="Runs",
    request=RunsRequest,
    run=run,
    examples=("runs --runs lab/runs", "runs --verify"),
)
