"""Routes of a force plate's zero: show the change of the cell file, then write it."""

from __future__ import annotations

import asyncio
from typing import Annotated, Self

from fastapi import APIRouter, Body

from config.cell.plate import CHANNEL_NAMES, PlateZero
from config.errors import ConfigError
from rid_daq.service.api.cells import LeaseKey
from rid_daq.service.api.context import OfCell, Operator, Service
from rid_daq.service.api.runs import run_folder
from rid_daq.service.files.file_check import check_content
from rid_daq.service.files.zero_change import ZeroChange
from rid_daq.service.records import Record, ShortText

router = APIRouter(prefix="/api/v1/cells/{cell}/plate-zero", tags=["cells"])


class PlannedZero(Record):
    """Zero of a force plate in the cell file, and the zero that a run has measured.

    Attributes:
        file: Name of the cell file.
        version: Version of the file on which the change is based.
        channels: Names of the channels, in the order of the offsets.
        before: Zero in the file; null if it has none.
        after: Measured zero.
        measured_utc: Time of the run.
    """

    file: str
    version: str
    channels: tuple[str, ...] = CHANNEL_NAMES
    before: PlateZero | None
    after: PlateZero
    measured_utc: str

    @classmethod
    def of(cls, change: ZeroChange) -> Self:
        """Return the answer of the API for a change."""
        return cls(
            file=change.file.shown,
            version=change.version,
            before=change.before,
            after=change.after,
            measured_utc=change.measured_utc,
        )


class ConfirmedZero(Record):
    """Run whose zero is written, and the version of the cell file that the user has seen."""

    run: ShortText
    version: ShortText


@router.get("")
def plan_zero(cell: OfCell, service: Service, who: Operator, run: str) -> PlannedZero:
    """Return the change of the cell file to the zero that a run has measured."""
    return PlannedZero.of(ZeroChange.of(service, cell, run_folder(service, run)))


@router.post("")
async def save_zero(
    cell: OfCell,
    service: Service,
    who: Operator,
    confirmed: Annotated[ConfirmedZero, Body()],
    lease: LeaseKey = None,
) -> PlannedZero:
    """Write the zero that a run has measured into the cell file.

    An operator can do this although other changes of a cell file need an administrator, because
    `plate_zero` with `write` also changes nothing but the zero. The file must still have the
    version that the user has seen; no other client may hold the cell, and no job may use its bus.
    """
    folder = await asyncio.to_thread(run_folder, service, confirmed.run)
    change = await asyncio.to_thread(ZeroChange.of, service, cell, folder)
    file = change.file
    with file.unused(service, lease):
        found = await asyncio.to_thread(check_content, file, change.content)
        for problem in (*found.problems, *found.cell_problems):
            raise ConfigError(f"{file.shown}: {problem.text}", code=problem.code)
        await asyncio.to_thread(file.save, change.content, confirmed.version)
    details = f"plate.zero of {file.shown}, run {confirmed.run}"
    service.audit.note(who.name, "wrote a zero", cell.name, details)
    return PlannedZero.of(change)
