"""`RestoredDrives`: result of restoring drive settings, and the request for it."""

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
    """Restore settings of drives."""

    cell: CellName
    dry_run: Annotated[bool, Field(description="Show the differences only; write nothing.")] = False
    store: Annotated[
        bool,
        Field(description="Afterwards store all settings in the drives' permanent memory (1010h)."),
    ] = False
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class RestoredDrives:
    """Drive settings that were restored, or that differ.

    Attributes:
        cell: Name of the cell.
        joints: Joint name by node id.
        settings: Settings that differed, or whose previous value is unknown.
        write_log: Log of written and previous values; None if nothing was written.
    """

    request: RestoreRequest
    cell: str
    joints: dict[int, str]
    settings: tuple[RestoredSetting, ...]
    write_log: Path | None

    @property
    def settings_not_restored(self) -> tuple[RestoredSetting, ...]:
        """Settings that differ after the restore, or whose saved value is unknown."""
        if self.request.dry_run:
            return ()
        return tuple(each for each in self.settings if not each.restored)

    @property
    def failure(self) -> PreflightError | None:
        """Error with the settings that were not restored; None without any, or on a dry run."""
        if not self.settings_not_restored:
            return None
        return PreflightError(
            "; ".join(map(self._sentence, self.settings_not_restored)), code="RID-DRIVE-SETTINGS"
        )

    @property
    def exit_code(self) -> int:
        """Exit code 3 if a drive does not contain the saved settings."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.PREFLIGHT if self.settings_not_restored else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return every setting that differed, with its values before and after."""
        return {
            "cell": self.cell,
            "dry_run": self.request.dry_run,
            "write_log": None if self.write_log is None else str(self.write_log),
            "settings": [
                {
                    "joint": self.joints[each.node_id],
                    "node": each.node_id,
                    "object": each.name,
                    "saved": _value_text(each.saved),
                    "before": _value_text(each.before),
                    "after": _value_text(each.after),
                    "restored": each.restored,
                    "refusal": each.refusal,
                }
                for each in self.settings
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the table of settings, the write log and the verdict."""
        request = self.request
        yield table(
            self.settings,
            Cells("drive", lambda each: f"{self.joints[each.node_id]}, node {each.node_id}"),
            Cells("object", lambda each: each.name),
            Cells("saved", lambda each: _value_text(each.saved)),
            Cells("before", lambda each: _value_text(each.before)),
            Cells("now", lambda each: _value_text(each.after)),
            failed=lambda each: not request.dry_run and not each.restored,
        )
        if request.dry_run:
            yield Text(text=f"{len(self.settings)} settings differ. Nothing was written.")
            return
        if self.write_log is not None:
            yield Text(text=f"Log of written and previous values: {self.write_log}")
        if self.settings_not_restored:
            text = f"Cell {self.cell}: the drives do not contain all saved settings."
            yield Verdict(passed=False, text=text)
            return
        count = len(self.settings)
        what = f"{count} settings were restored" if count else "No setting differed"
        kept = " The drives have stored them permanently." if request.store else ""
        yield Verdict(passed=True, text=f"{what}; the drives contain the saved settings.{kept}")

    def _sentence(self, each: RestoredSetting) -> str:
        where = f"{self.joints[each.node_id]} (node {each.node_id}), {each.name}"
        if each.saved is None:
            before = _value_text(each.before)
            return f"{where}: the value before the run is unknown ({before}); set it manually"
        why = f" ({each.refusal})" if each.refusal else ""
        return f"{where}: is {_value_text(each.after)} instead of {_value_text(each.saved)}{why}"


def _value_text(value: bytes | str | None) -> str:
    """Return the value of an object as text: hexadecimal digits for a number."""
    from drivers.device_text import printable

    if value is None:
        return "unknown"
    if isinstance(value, str):
        return value
    if len(value) <= 8:
        return f"{int.from_bytes(value, 'little'):0{2 * len(value)}X}h"
    return printable(value.rstrip(b"\0"))
