"""`run_head_blocks`: the head of a report: run, operator, devices, files and software of a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, Manifest
from config.errors import RidDaqError
from rid_daq.blocks.block import AnyBlock, Cells, Text, table
from rid_daq.blocks.formats import format_utc
from rid_daq.report.result import Result
from rid_daq.runs.devices import cell_of_run, drives_with_serials
from rid_daq.runs.run_data import CELL, FEEDFORWARD, MOTION, ROBOT, SESSION
from rid_daq.terminal.choices import MODEL, PAYLOAD

NOT_RECORDED: Final = "not recorded"
_FILES: Final = (CELL, ROBOT, MOTION, FEEDFORWARD, SESSION, RECORDING, MODEL, PAYLOAD)
_SHOWN: Final = 16


def run_head_blocks(folder: RunFolder, result: Result) -> Iterator[AnyBlock]:
    """Yield a table of the run, its operator, devices, files, model and software.

    Args:
        folder: The run.
        result: Result of the run, whose model is named.
    """
    manifest = folder.manifest()
    rows = [*_run_rows(manifest), *_device_rows(folder)]
    if result.model is not None:
        rows.append(("Model", f"{result.model.name} (SHA-256 {result.model.sha256[:_SHOWN]}…)"))
    rows += [
        (name, f"SHA-256 {manifest.files[name].sha256[:_SHOWN]}…")
        for name in _FILES
        if name in manifest.files
    ]
    software = manifest.software
    words = [f"{name} {software[name]}" for name in ("rid-daq", "commit") if name in software]
    rows.append(("Made with", ", ".join(words) or None))
    yield table(rows, Cells("", lambda row: row[0]), Cells("", lambda row: row[1] or NOT_RECORDED))
    yield Text(
        text="The complete SHA-256 of these files is in manifest.json in the same folder.",
        is_note=True,
    )


def _run_rows(manifest: Manifest) -> Iterator[tuple[str, str | None]]:
    def fact(name: str) -> str | None:
        found = manifest.facts.get(name)
        return str(found) if found else None

    yield "Run", f"{manifest.label} ({manifest.run_id})"
    yield "Operator", fact("operator")
    if cell := fact("cell"):
        yield "Cell", cell
    yield "Begun", format_utc(manifest.created_utc)
    if manifest.finished_utc:
        yield "Ended", format_utc(manifest.finished_utc)


def _device_rows(folder: RunFolder) -> Iterator[tuple[str, str | None]]:
    """Yield the serial numbers of the run's drives; a damaged file must not prevent the report."""
    try:
        cell = cell_of_run(folder)
        if cell is None:
            return
        for drive, serial in drives_with_serials([cell], [folder]):
            yield f"Serial number, {drive}", serial
    except RidDaqError as error:
        yield "Serial numbers", f"cannot be read: {error}"
