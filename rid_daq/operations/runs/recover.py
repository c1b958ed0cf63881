"""`recover`: write the readable part of a damaged recording as a new recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.errors import ConfigError, RecordingError
from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from acquisition.session.repair import Repair
    from rid_daq.operations.runs.recovery import Recovery


class RecoverRequest(Request):
    """Write the readable part of a damaged recording as a new recording.

    The old recording is not changed. Only blocks with a correct checksum are copied, so all numbers
    in the new recording are as recorded. The number of rows that are known to be lost is reported.
    A run becomes a new run folder that all commands can read.

    In a terminal: exit code 1 if rows are known to be lost, 7 if nothing is readable.
    """

    what: Annotated[
        str,
        Field(description="Recording (.mcap), or a run: its folder, id or label."),
        Option(positional=True, metavar="FILE|RUN", file="input"),
    ]
    runs: RunsFolder = DEFAULT_RUNS
    output: Annotated[
        Path | None,
        Field(
            description="For a file: the file to write; for a run: the folder in which the new"
            " run folder is made. If not set, next to the old one."
        ),
        Option(short="o", metavar="PATH", group=FILES, file="output"),
    ] = None


@dataclass(frozen=True)
class RecoverResult:
    """A recording or a run that was recovered.

    Attributes:
        recovery: The copied and the lost rows.
        is_run: True for a run folder, False for a file.
    """

    recovery: Recovery
    is_run: bool

    @property
    def exit_code(self) -> int:
        """Exit code 1 if rows are known to be lost."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.VERDICT_FAILED if self.recovery.lost_rows else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return the folders, the lost rows, each recording's repair, and the notes."""
        recovery = self.recovery
        return {
            "source": str(recovery.source),
            "recovered": None if recovery.target is None else str(recovery.target),
            "rows_lost": recovery.lost_rows,
            "seconds_lost": recovery.lost_s,
            "recordings": {name: _repair_document(each) for name, each in recovery.repairs.items()},
            "notes": list(recovery.notes),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the copied rows of each recording, notes, the verdict and the next command."""
        from acquisition.runs.manifest import RECORDING

        recovery = self.recovery
        for name, repair in recovery.repairs.items():
            for number, sentence in enumerate(repair.sentences):
                yield Text(text=f"{name}: {sentence}" if number == 0 else f"  {sentence}")
        yield from note_blocks(recovery.notes)
        if recovery.target is None:
            text = f"{recovery.source} is undamaged; there is nothing to recover"
            yield Verdict(passed=True, text=text)
            return
        yield Verdict(passed=not recovery.lost_rows, text=f"Recovered: {recovery.target}")
        if self.is_run and RECORDING in recovery.repairs:
            yield Next(words=("average", str(recovery.target)))


def run(request: RecoverRequest, _context: Context) -> RecoverResult:
    """Recover a file or a run."""
    from rid_daq.operations.runs.recovery import recover_file, recover_run

    path = Path(request.what)
    if path.is_file():
        target = request.output or path.with_name(f"{path.stem}-recovered.mcap")
        return RecoverResult(recover_file(path, target), is_run=False)
    source = _run_folder(request.runs, request.what)
    return RecoverResult(
        recover_run(source, request.output or source.resolve().parent), is_run=True
    )


def _run_folder(runs: Path, what: str) -> Path:
    """Return a run's folder, even if its manifest cannot be read."""
    from acquisition.runs.catalogue import find_run

    for path in (Path(what), runs / what):
        if what not in ("", ".", "..") and path.is_dir():
            return path
    if Path(what).suffix == ".mcap":
        raise RecordingError(f"{what}: there is no such file", code="RID-FILE-UNKNOWN")
    try:
        return find_run(runs, what).path
    except ConfigError as error:
        raise ConfigError(
            f"{error}; give the path of a run folder or of an .mcap file", code=error.refusal
        ) from error


def _repair_document(repair: Repair) -> dict[str, object]:
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


OPERATION: Final = Operation(
    name="recover",
    label="Recover a recording",
    request=RecoverRequest,
    run=run,
    examples=("recover latest --json", "recover recording.mcap --output readable.mcap"),
    module="rid_daq.operations.runs.recovery",
)
