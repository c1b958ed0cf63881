"""`rid-daq drives`: what the drives hold: kept in a file, put back, or back to before a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from config.errors import PreflightError
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.option_sections import SectionedCommand
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, CellName, Overwrite, RunsFolder

if TYPE_CHECKING:
    from drivers.servo.drive_settings import RestoredSetting
    from rid_daq.jobs.drives.drives_job import DrivesRestored, RestoreRequest

drives = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="What the drives hold: keep it, put it back, or undo what a run wrote.",
)

DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what differs; write nothing.")]
Store = Annotated[
    bool,
    typer.Option("--store", help="Afterwards let the drives keep all they hold (1010h)."),
]


@drives.command(
    "backup", cls=SectionedCommand, short_help="every setting of a cell's drives into a file"
)
def backup(
    cell: CellName,
    output: Annotated[Path, typer.Option("-o", "--output", help="Where to write it (JSON).")],
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Write down every setting of a cell's drives; nothing is written to them.

    Of a drive whose axis names a data sheet (EDS) all objects that may be written, of others those
    that CiA 301 and 402 know.
    """
    from rid_daq.jobs.drives.drives_job import backup_drives

    console = Console(as_json)
    kept = backup_drives(cell, output, overwrite=overwrite)
    counts = {drive.node_id: len(drive.values) for drive in kept.drives}
    console.document({"cell": kept.cell, "file": str(output), "settings": counts})
    console.say(
        f"{output}: wrote "
        + ", ".join(f"{count} settings of node {node}" for node, count in counts.items())
        + "."
    )
    console.next_step("drives", "restore", cell, output, "--dry-run")


@drives.command("restore", cls=SectionedCommand, short_help="the drives hold what a backup says")
def restore(
    cell: CellName,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A backup of these drives.")],
    dry_run: DryRun = False,
    store: Store = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Make a cell's drives hold what a backup says; what differs is written and read back.

    Refused while a session runs, where a drive is powered, and where one is another drive than the
    backup's (1018h). Exit code 3 where one does not hold afterwards what it held.
    """
    from rid_daq.jobs.drives.drives_job import RestoreRequest, restore_backup

    console = Console(as_json)
    request = RestoreRequest(cell, runs, dry_run, store)
    _print(console, restore_backup(file, request), request)


@drives.command(
    "rollback", cls=SectionedCommand, short_help="what a run wrote to the drives, undone"
)
def rollback(
    cell: CellName,
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A run, or the write log of another command.")
    ],
    dry_run: DryRun = False,
    store: Store = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Undo what a run wrote to a cell's drives: they hold what they held before it.

    Also of a run whose program was killed. Refusals and exit codes as of `restore`.
    """
    from rid_daq.jobs.drives.drives_job import RestoreRequest, roll_back

    console = Console(as_json)
    request = RestoreRequest(cell, runs, dry_run, store)
    _print(console, roll_back(run, request), request)


@drives.command("fit", cls=SectionedCommand, short_help="the keys that a drive's data sheet needs")
def fit(
    eds: Annotated[
        Path, typer.Argument(metavar="SHEET", help="The drive's data sheet (EDS or DCF).")
    ],
    cell: Annotated[
        str, typer.Option("--cell", help="The cell whose first axis it will move.")
    ] = "ir361",
    as_json: AsJson = False,
) -> None:
    """Print the keys for a cell file so that the drive of a data sheet can be used.

    Numbers that no data sheet has are printed as '?': a cell file is refused until they are
    replaced. Exit code 1 if the drive cannot be used; the reason says whether it concerns safety.
    """
    from rid_daq.jobs.drives.fit_job import fit_eds_file

    console = Console(as_json)
    found = fit_eds_file(eds, cell)
    done = found.fit
    console.document(
        {
            "file": str(eds),
            "accepted": done.accepted,
            "profile": done.base,
            "identity": found.identity,
            "servo": done.keys,
            "reason": done.reason,
            "concerns_safety": done.concerns_safety,
            "lacks": [
                {"object": each.object_name, "name": each.name, "safety": done.protects(each)}
                for each in done.findings
            ],
        }
    )
    for line in done.lines:
        console.say(line)
    for each in done.findings:
        safety = "safety" if done.protects(each) else "no safety"
        console.say(f"lacks {each.object_name} {each.name} ({safety})")
    if not done.accepted:
        console.verdict(False, f"{eds}: this drive cannot be used: {done.reason}.")
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    profile = f"with the bundled profile {done.base}" if done.base else "by CiA 402"
    keys = f" and the {len(done.lines)} lines above" if done.lines else ""
    console.verdict(True, f"{eds}: this drive can be used {profile}{keys}.")


def _print(console: Console, done: DrivesRestored, request: RestoreRequest) -> None:
    console.document(
        {
            "cell": done.cell,
            "dry_run": request.dry_run,
            "write_log": None if done.write_log is None else str(done.write_log),
            "settings": [
                {
                    "joint": done.joints[each.node_id],
                    "node": each.node_id,
                    "object": each.name,
                    "saved": _shown(each.saved),
                    "before": _shown(each.before),
                    "after": _shown(each.after),
                    "restored": each.restored,
                    "refusal": each.refusal,
                }
                for each in done.settings
            ],
        }
    )
    console.table(
        ("drive", "object", "saved", "before", "now"),
        [
            (
                f"{done.joints[each.node_id]}, node {each.node_id}",
                each.name,
                _shown(each.saved),
                _shown(each.before),
                _shown(each.after),
            )
            for each in done.settings
        ],
        red=[not request.dry_run and not each.restored for each in done.settings],
    )
    if request.dry_run:
        console.say(f"{len(done.settings)} settings differ. Nothing was written.")
        return
    if done.write_log is not None:
        console.say(f"What was written, and what was there: {done.write_log}")
    if done.left:
        console.verdict(False, f"Cell {done.cell}: its drives do not hold all that was saved.")
        raise PreflightError(
            "; ".join(_sentence(done, each) for each in done.left), code="RID-DRIVE-SETTINGS"
        )
    count = len(done.settings)
    what = f"{count} settings were put back" if count else "Nothing differed"
    kept = " The drives keep it." if request.store else ""
    console.verdict(True, f"{what}; the drives hold what was saved.{kept}")


def _sentence(done: DrivesRestored, each: RestoredSetting) -> str:
    where = f"{done.joints[each.node_id]} (node {each.node_id}), {each.name}"
    if each.saved is None:
        return f"{where}: what it held before is not known ({_shown(each.before)}); set it by hand"
    why = f" ({each.refusal})" if each.refusal else ""
    return f"{where}: holds {_shown(each.after)} in place of {_shown(each.saved)}{why}"


def _shown(value: bytes | str | None) -> str:
    """Return what an object holds: a number as hexadecimal digits, a text as one."""
    from drivers.device_text import printable

    if value is None:
        return "not known"
    if isinstance(value, str):
        return value
    if len(value) <= 8:
        return f"{int.from_bytes(value, 'little'):0{2 * len(value)}X}h"
    return printable(value.rstrip(b"\0"))
