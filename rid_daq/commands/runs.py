"""`rid-daq runs`: list the runs, and check that their files are unchanged."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from config.errors import ConfigError, RecordingError
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, RunsFolder

_ROOMY = 120  # columns


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
    found: list[dict[str, Any]] = []
    for run, manifest in list_runs(folder):
        entry: dict[str, Any] = {
            "run": manifest.run_id,
            "label": manifest.label,
            "kind": manifest.kind,
            "status": manifest.status,
            "created_utc": manifest.created_utc,
            "folder": str(run.path),
            "facts": manifest.facts,
        }
        if verify:
            entry["problems"] = list(run.verify())
            entry["strays"] = list(run.strays())
        found.append(entry)
    damaged = [(run.run_id, str(problem)) for run, problem in damaged_runs(folder)]
    if verify and not found and not damaged:
        raise ConfigError(f"{folder}: there are no runs, so nothing can be verified")
    console.document({"runs": found, "damaged": [problem for _, problem in damaged]})
    if not found and not damaged:
        console.say(f"{folder}: no runs yet. `rid-daq demo` or `rid-daq record` make some.")
    elif found:
        _print(console, found)
    for entry in found:
        if entry.get("strays"):
            names = ", ".join(entry["strays"])
            console.say(f"note: {entry['run']}: not of the run, and left alone: {names}")
    problems = [(e["run"], problem) for e in found for problem in e.get("problems", [])]
    if verify:
        problems += damaged
        whole = len(found) + len(damaged) - len({run for run, _ in problems})
        told = f"Whole, as they were written: {whole} of {len(found) + len(damaged)} runs."
        console.verdict(not problems, told)
    else:
        for _, problem in damaged:
            console.verdict(False, f"damaged: {problem}")
    if problems:
        lines = "\n".join(f"  {run}: {problem}" for run, problem in problems)
        raise RecordingError(f"problems in the run folders: {len(problems)}\n{lines}")


def _print(console: Console, found: list[dict[str, Any]]) -> None:
    """Write the table; facts have a column where there is room for one."""
    roomy = console.columns is None or console.columns >= _ROOMY
    wider = ("more",) if roomy else ()
    console.table(
        ("run", "created (UTC)", "kind", "status", "label", *wider),
        [
            (
                entry["run"],
                entry["created_utc"][:16].replace("T", " "),
                entry["kind"],
                entry["status"],
                entry["label"],
                *((", ".join(f"{k} {v}" for k, v in entry["facts"].items()),) if roomy else ()),
            )
            for entry in found
        ],
        red=[entry["status"] != "complete" or bool(entry.get("problems")) for entry in found],
    )
