"""Routes of cells: their status and their leases."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Header

from rid_daq.service.api.context import OfCell, Operator, Service, Who
from rid_daq.service.folder_files import folder_files
from rid_daq.service.records import (
    CellStatus,
    FilesOfCell,
    HeldLease,
    Lease,
    Preflight,
    Record,
    ShortText,
)
from rid_daq.service.refusals import StoreBusyError

router = APIRouter(prefix="/api/v1/cells", tags=["cells"])

LeaseKey = Annotated[
    str | None, Header(alias="x-rid-daq-lease", description="The key of the cell's lease.")
]


class LeaseCreation(Record):
    """Request for a lease.

    `confirmed` is the cell's name, typed by a person who takes the cell over from another client.
    """

    note: ShortText = ""
    seconds: float = 15.0
    confirmed: ShortText | None = None


class LeaseRenewal(Record):
    """New duration of a lease [s]."""

    seconds: float = 15.0


@router.get("")
async def list_cells(service: Service, who: Who) -> list[CellStatus]:
    """Return the present status of every cell."""
    return [service.status(cell) for cell in service.cells.values()]


@router.get("/{cell}")
async def get_cell(cell: OfCell, service: Service) -> CellStatus:
    """Return the present status of a cell."""
    return service.status(cell)


@router.get("/{cell}/preflight")
async def get_preflight(cell: OfCell, service: Service) -> Preflight | None:
    """Return the newest preflight with all its lines."""
    return service.readiness.preflight(cell)


@router.get("/{cell}/files")
def list_files_of_cell(cell: OfCell, service: Service) -> FilesOfCell:
    """Return the motions, models, loops, feedforwards and payloads that requests may name.

    Motions, models and payloads that contain the name of another robot are left out.
    """
    return folder_files(service, cell.loaded.robot.name)


@router.get("/{cell}/lease")
async def get_lease(cell: OfCell, service: Service) -> Lease | None:
    """Return the lease of the cell."""
    return service.leases.lease_of(cell.name)


@router.post("/{cell}/lease", status_code=HTTPStatus.CREATED)
async def take_lease(
    cell: OfCell, service: Service, who: Operator, wanted: Annotated[LeaseCreation, Body()]
) -> HeldLease:
    """Take the cell's lease; a person can take it over from a client by typing the cell's name."""
    before = service.leases.lease_of(cell.name)
    lease = service.leases.take(cell.name, who, wanted.note, wanted.seconds, wanted.confirmed)
    try:
        await service.database.wait_until_saved()
    except StoreBusyError:
        service.leases.give_back(cell.name, lease.key)
        raise
    over = "" if before is None else f"over from {before.owner}"
    service.audit.note(who.name, "took the cell", cell.name, f"{over} {wanted.note}".strip())
    return lease


@router.put("/{cell}/lease")
async def renew_lease(
    cell: OfCell,
    service: Service,
    who: Operator,
    renewed: Annotated[LeaseRenewal, Body()],
    key: LeaseKey = None,
) -> Lease:
    """Renew the lease; its holder does this regularly, as a heartbeat."""
    return service.leases.renew(cell.name, key or "", renewed.seconds)


@router.delete("/{cell}/lease", status_code=HTTPStatus.NO_CONTENT)
async def give_lease_back(
    cell: OfCell, service: Service, who: Operator, key: LeaseKey = None
) -> None:
    """End the cell's lease."""
    service.leases.give_back(cell.name, key or "")
    service.audit.note(who.name, "gave the cell back", cell.name)
