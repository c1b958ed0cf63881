"""`RestoredDrives`: the settings of drives that were put back, and the request for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from config.errors import PreflightError
from rid_daq.blocks.block import AnyBlock, Cells, Text, Verdict, table
from rid_daq.requests.option import DEFAULT_RUNS, CellName, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from drivers.servo.drive_settings import RestoredSetting


class RestoreRequest(Request):
    """Put settings of drives back."""

    cell: CellName
    dry_run: Annotated[bool, Field(description="Show the differences; write nothing.")] = False
    store: Annotated[
        bool, Field(description="Then let the drives store all their settings (1010h).")
    ] = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class RestoredDrives:
    """The settings of drives that were put back, or that differ.

    Attributes:
        cell: The cell's name.
        joints: The joint of every node.
        settings: What differed, or is not known.
        write_log: What was written, and what was there; None if nothing was.
    """

    request: RestoreRequest
    cell: str
    joints: dict[int, str]
    settings: tuple[RestoredSetting, ...]
    write_log: Path | None

    @property
    def left(self) -> tuple[RestoredSetting, ...]:
        """The settings that differ from the saved ones after they were put back."""
        if self.request.dry_run:
            return ()
        return tuple(each for each in self.settings if not each.restored)

    @property
    def failure(self) -> PreflightError | None:
        """The settings that could not be put back; None if there are none."""
        if not self.left:
            return None
        return PreflightError("; ".join(map(self._sentence, self.left)), code="RID-DRIVE-SETTINGS")

    @property
    def exit_code(self) -> int:
        """3 if a drive does not hold what was saved."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.PREFLIGHT if self.left else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return every setting that differed, before and after."""
        return {
            "cell": self.cell,
            "dry_run": self.request.dry_run,
            "write_log": None if self.write_log is None else str(self.write_log),
            "settings": [
                {
                    "joint": self.joints[each.node_id],
                    "node": each.node_id,
                    "object": each.name,
                    "saved": _shown(each.saved),
                    "before": _shown(each.before),
                    "after": _shown(each.after),
                    "restored": each.restored,
                    "refusal": each.refusal,
                }
                for each in self.settings
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the table, the write log and the verdict."""
        request = self.request
        yield table(
            self.settings,
            Cells("drive", lambda each: f"{self.joints[each.node_id]}, node {each.node_id}"),
            Cells("object", lambda each: each.name),
            Cells("saved", lambda each: _shown(each.saved)),
            Cells("before", lambda each: _shown(each.before)),
            Cells("now", lambda each: _shown(each.after)),
            failed=lambda each: not request.dry_run and not each.restored,
        )
        if request.dry_run:
            yield Text(text=f"{len(self.settings)} settings differ. Nothing was written.")
            return
        if self.write_log is not None:
            yield Text(text=f"Written values, and those before: {self.write_log}")
        if self.left:
            text = f"Cell {self.cell}: its drives do not hold all that was saved."
            yield Verdict(passed=False, text=text)
            return
        count = len(self.settings)
        what = f"{count} settings were put back" if count else "Nothing differed"
        kept = " The drives keep it." if request.store else ""
        yield Verdict(passed=True, text=f"{what}; the drives hold what was saved.{kept}")

    def _sentence(self, each: RestoredSetting) -> str:
        where = f"{self.joints[each.node_id]} (node {each.node_id}), {each.name}"
        if each.saved is None:
            before = _shown(each.before)
            return f"{where}: its value before is not known ({before}); set it by hand"
        why = f" ({each.refusal})" if each.refusal else ""
        return f"{where}: holds {_shown(each.after)} instead of {_shown(each.saved)}{why}"


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
