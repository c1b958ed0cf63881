"""`rid-daq runs`: list the runs, and check that their files are unchanged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import typer

from config.errors import ConfigError, RecordingError
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder

_ROOMY = 120  # columns


@dataclass(frozen=True)
class _Listed:
    """A run as the document has it; problems and strays are None where nobody looked."""

    run: str
    label: str
    kind: str
    status: str
    created_utc: str
    folder: str
    facts: Mapping[str, object]
    problems: list[str] | None
    strays: list[str] | None

    def document(self) -> dict[str, object]:
        """Return it for the JSON document."""
        return {name: value for name, value in vars(self).items() if value is not None}


def runs(
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare every file with the run's manifest.")
    ] = False,
    folder: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """List the runs, oldest first; with --verify, check that no file was changed.

    Files that do not belong to a run are named, and are no problem. With --verify, exit code 7
    where a file was changed or is gone.
    """
    from acquisition.runs.catalogue import damaged_runs, list_runs

    console = Console(as_json)
    found = [
        _Listed(
            run=manifest.run_id,
            label=manifest.label,
            kind=manifest.kind,
            status=manifest.status,
            created_utc=manifest.created_utc,
            folder=str(run.path),
            facts=manifest.facts,
            problems=list(run.verify()) if verify else None,
            strays=list(run.strays()) if verify else None,
        )
        for run, manifest in list_runs(folder)
    ]
    damaged = [(run.run_id, str(problem)) for run, problem in damaged_runs(folder)]
    if verify and not found and not damaged:
        raise ConfigError(
            f"{folder}: there are no runs, so nothing can be verified", code="RID-RUN-UNKNOWN"
        )
    told = [problem for _, problem in damaged]
    console.document({"runs": [each.document() for each in found], "damaged": told})
    if not found and not damaged:
        console.say(f"{folder}: no runs yet. `rid-daq demo` or `rid-daq record` make some.")
    elif found:
        _print(console, found)
    for entry in found:
        if entry.strays:
            names = ", ".join(entry.strays)
            console.say(f"note: {entry.run}: not of the run, and left alone: {names}")
    problems = [(each.run, problem) for each in found for problem in each.problems or ()]
    if verify:
        problems += damaged
        whole = len(found) + len(damaged) - len({run for run, _ in problems})
        said = f"Whole, as they were written: {whole} of {len(found) + len(damaged)} runs."
        console.verdict(not problems, said)
    else:
        for _, problem in damaged:
            console.verdict(False, f"damaged: {problem}")
    if problems:
        lines = "\n".join(f"  {run}: {problem}" for run, problem in problems)
        raise RecordingError(
            f"problems in the run folders: {len(problems)}\n{lines}", code="RID-RUN-DAMAGED"
        )


def _print(console: Console, found: list[_Listed]) -> None:
    """Write the table; facts have a column where there is room for one."""
    roomy = console.columns is None or console.columns >= _ROOMY
    wider = ("more",) if roomy else ()
    console.table(
        ("run", "created (UTC)", "kind", "status", "label", *wider),
        [
            (
                entry.run,
                entry.created_utc[:16].replace("T", " "),
                entry.kind,
                entry.status,
                entry.label,
                *((", ".join(f"{k} {v}" for k, v in entry.facts.items()),) if roomy else ()),
            )
            for entry in found
        ],
        red=[entry.status != "complete" or bool(entry.problems) for entry in found],
    )
