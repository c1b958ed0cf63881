"""What `rid-daq recover` does, and says of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from acquisition.runs.catalogue import find_run
from acquisition.session.repair import Repair
from config.errors import ConfigError, RecordingError
from config.ranges import Ranged
from rid_daq.jobs.recovery_job import Recovery, recover_file, recover_run
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.options import DEFAULT_RUNS


@dataclass(frozen=True)
class RecoverRequest(Ranged):
    """What is recovered, and where to.

    Attributes
    ----------
    what : str
        A recording (.mcap), or a run folder, its id or label.
    runs : Path
        The folder of the run folders.
    output : Path or None
        Of a file: the file to write; of a run: the folder for the new run folder. Beside the old
        one if None.
    """

    what: str
    runs: Path = DEFAULT_RUNS
    output: Path | None = None


def perform(request: RecoverRequest, console: Console) -> None:
    """Recover, and say what could be."""
    path = Path(request.what)
    if path.is_file():
        target = request.output or path.with_name(f"{path.stem}-recovered.mcap")
        recovery = recover_file(path, target)
    else:
        source = _run_folder(request.runs, request.what)
        recovery = recover_run(source, request.output or source.resolve().parent)
    _print(console, recovery, is_run=not path.is_file())
    if recovery.lost_rows:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _run_folder(runs: Path, what: str) -> Path:
    """Return a run's folder, its manifest readable or not."""
    for path in (Path(what), runs / what):
        if what not in ("", ".", "..") and path.is_dir():
            return path
    if Path(what).suffix == ".mcap":
        raise RecordingError(f"{what}: no such file", code="RID-FILE-UNKNOWN")
    try:
        return find_run(runs, what).path
    except ConfigError as error:
        raise ConfigError(
            f"{error}; give the path of a run folder or of an .mcap file", code=error.refusal
        ) from error


def _print(console: Console, recovery: Recovery, *, is_run: bool) -> None:
    console.document(
        {
            "source": str(recovery.source),
            "recovered": None if recovery.target is None else str(recovery.target),
            "rows_lost": recovery.lost_rows,
            "seconds_lost": recovery.lost_s,
            "recordings": {name: _entry(each) for name, each in recovery.repairs.items()},
            "notes": list(recovery.notes),
        }
    )
    for name, repair in recovery.repairs.items():
        for number, sentence in enumerate(repair.sentences):
            console.say(f"{name}: {sentence}" if number == 0 else f"  {sentence}")
    for note in recovery.notes:
        console.say(f"note: {note}")
    if recovery.target is None:
        console.verdict(True, f"{recovery.source}: is whole; there is nothing to recover")
        return
    console.verdict(not recovery.lost_rows, f"Recovered: {recovery.target}")
    if is_run and "recording.mcap" in recovery.repairs:
        console.next_step("average", recovery.target)


def _entry(repair: Repair) -> dict[str, object]:
    return {
        "rows": repair.kept_rows,
        "seconds": repair.kept_s,
        "rows_lost": repair.lost_rows,
        "seconds_lost": repair.lost_s,
        "closed": repair.damage.finished,
        "torn_bytes": repair.damage.torn_bytes,
        "bad_blocks": repair.damage.bad_chunks,
        "gaps": [{"first_row": first, "rows": count} for first, count in repair.damage.gaps],
    }
