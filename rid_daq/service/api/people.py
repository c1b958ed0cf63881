"""Routes of who may come in: tokens, pairing, and the log of who did what."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Query, Request, Response
from pydantic import Field

from rid_daq.service.api.context import Administrator, Door, Service, Who
from rid_daq.service.pairing import WaitingDevice
from rid_daq.service.records import AuditEntry, Identity, Record, Role, ShortText, Token
from rid_daq.service.refusals import NotKnownError, StoreBusyError, UnknownError

router = APIRouter(prefix="/api/v1", tags=["people"])


class TokenWanted(Record):
    """A token that is to be made, for a program or a person."""

    name: ShortText
    role: Role = Role.OPERATOR
    person: bool = False


class NewToken(Token):
    """A token with its secret, which is shown this once."""

    secret: str


class TicketWanted(Record):
    """The path that a browser is to open or save, as its address has it."""

    path: str = Field(max_length=2000)


class NewTicket(Record):
    """A ticket."""

    ticket: str


class PairingBegun(Record):
    """What a new device shows, and the secret that it asks again with."""

    code: str
    secret: str


class PairingAsked(Record):
    """The secret of a device that waits."""

    secret: ShortText


class PairingState(Record):
    """Whether a device has been let in; with TLS its cookie is set then."""

    confirmed: bool
    key: str = Field(default="", description="Without TLS: the session secret, a bearer token.")


class PairingConfirmed(Record):
    """The code that a device shows, typed by a person; the device's name and role."""

    code: str = Field(max_length=20)
    name: ShortText
    role: Role = Role.OPERATOR


@router.get("/whoami")
async def who_am_i(who: Who) -> Identity:
    """Return who asks."""
    return who


@router.get("/tokens")
async def list_tokens(who: Administrator, service: Service) -> list[Token]:
    """Return the tokens, without their secrets."""
    return list(service.tokens.all())


@router.post("/tokens", status_code=HTTPStatus.CREATED)
async def make_token(
    who: Administrator, service: Service, wanted: Annotated[TokenWanted, Body()]
) -> NewToken:
    """Make a token; its secret is shown this once."""
    token, secret = service.tokens.add(wanted.name, wanted.role, person=wanted.person)
    try:
        await service.database.saved()
    except StoreBusyError:
        service.tokens.revoke(token.id)
        raise
    service.audit.note(who.name, "made a token", details=f"{token.name}, {token.role.value}")
    return NewToken(**token.model_dump(), secret=secret)


@router.delete("/tokens/{token}", status_code=HTTPStatus.NO_CONTENT)
async def revoke_token(token: str, who: Administrator, service: Service) -> None:
    """Let somebody in no more, and end the leases that they have taken."""
    if not service.tokens.revoke(token):
        raise UnknownError(f"no token {token!r}", code="RID-TOKEN-UNKNOWN")
    service.audit.note(who.name, "revoked a token", details=token)
    for cell in service.leases.end_of(token):
        service.audit.note(who.name, "ended the lease", cell, "its token was revoked")
    await service.database.saved()


@router.post("/tickets", status_code=HTTPStatus.CREATED)
async def make_ticket(
    who: Who, request: Request, door: Door, wanted: Annotated[TicketWanted, Body()]
) -> NewTicket:
    """Make a ticket: `?ticket=` lets one GET of this path through, within 30 s."""
    secret = door.secret_of(request.headers)
    if secret is None:
        raise NotKnownError("show a token: a ticket stands for one", code="RID-TICKET-NO-TOKEN")
    return NewTicket(ticket=door.tickets.issue(secret, wanted.path))


@router.post("/pairing", status_code=HTTPStatus.CREATED)
async def begin_pairing(request: Request, door: Door) -> PairingBegun:
    """Begin to pair this device: it shows the code, a person at the cell types it."""
    code, secret = door.pairing.begin("" if request.client is None else request.client.host)
    return PairingBegun(code=code, secret=secret)


@router.post("/pairing/state")
async def pairing_state(
    asked: Annotated[PairingAsked, Body()], door: Door, response: Response
) -> PairingState:
    """Return whether this device has been let in, and let it in then."""
    secret = door.pairing.collect(asked.secret)
    if secret is None:
        return PairingState(confirmed=False)
    if not door.secure:
        return PairingState(confirmed=True, key=secret)
    response.headers["set-cookie"] = door.cookie(secret)
    return PairingState(confirmed=True)


@router.get("/pairing")
async def list_waiting(who: Administrator, door: Door) -> list[WaitingDevice]:
    """Return the devices that wait to be let in, without their codes."""
    return list(door.pairing.waiting())


@router.post("/pairing/confirm", status_code=HTTPStatus.CREATED)
async def confirm_pairing(
    who: Administrator,
    door: Door,
    service: Service,
    confirmed: Annotated[PairingConfirmed, Body()],
) -> Token:
    """Let in the device that shows a code."""
    token = door.pairing.confirm(confirmed.code, confirmed.name, confirmed.role, who.token)
    service.audit.note(who.name, "paired a device", details=f"{token.name}, {token.role.value}")
    return token


@router.get("/audit")
def list_audit(
    who: Administrator, service: Service, limit: Annotated[int, Query(ge=1, le=5000)] = 200
) -> list[AuditEntry]:
    """Return who did what, newest first."""
    return list(service.audit.newest(limit))
