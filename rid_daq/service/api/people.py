"""Routes of access: tokens, pairing, and the log of user actions."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Body, Query, Request, Response
from pydantic import Field

from rid_daq.service.api.context import Administrator, Auth, Service, Who
from rid_daq.service.pairing import WaitingDevice
from rid_daq.service.records import AuditEntry, Identity, Record, Role, ShortText, Token
from rid_daq.service.refusals import NotKnownError, StoreBusyError, UnknownError

router = APIRouter(prefix="/api/v1", tags=["people"])


class TokenCreation(Record):
    """Request for a new token of a program or a person."""

    name: ShortText
    role: Role = Role.OPERATOR
    person: bool = False


class NewToken(Token):
    """Token with its secret, which is shown only in this answer."""

    secret: str


class TicketCreation(Record):
    """Path of the URL that a browser will open or save."""

    path: str = Field(max_length=2000)


class NewTicket(Record):
    """Ticket for one download."""

    ticket: str


class NewPairing(Record):
    """Code that a new device shows, and the secret with which it polls for its token."""

    code: str
    secret: str


class PairingQuery(Record):
    """Secret of a waiting device."""

    secret: ShortText


class PairingState(Record):
    """State of a device's pairing.

    With TLS, the answer in which `confirmed` is True also sets the device's cookie.
    """

    confirmed: bool
    key: str = Field(
        default="", description="Without TLS: the session secret, to be sent as a bearer token."
    )


class PairingConfirmation(Record):
    """Code on a device, typed by a person, with the device's name and role."""

    code: str = Field(max_length=20)
    name: ShortText
    role: Role = Role.OPERATOR


@router.get("/whoami")
async def who_am_i(who: Who) -> Identity:
    """Return the identity of the caller."""
    return who


@router.get("/tokens")
async def list_tokens(who: Administrator, service: Service) -> list[Token]:
    """Return the tokens, without their secrets."""
    return list(service.tokens.all())


@router.post("/tokens", status_code=HTTPStatus.CREATED)
async def make_token(
    who: Administrator, service: Service, wanted: Annotated[TokenCreation, Body()]
) -> NewToken:
    """Create a token; its secret is shown only in this answer."""
    token, secret = service.tokens.add(wanted.name, wanted.role, person=wanted.person)
    try:
        await service.database.wait_until_saved()
    except StoreBusyError:
        service.tokens.revoke(token.id)
        raise
    service.audit.note(who.name, "made a token", details=f"{token.name}, {token.role.value}")
    return NewToken(**token.model_dump(), secret=secret)


@router.delete("/tokens/{token}", status_code=HTTPStatus.NO_CONTENT)
async def revoke_token(token: str, who: Administrator, service: Service) -> None:
    """Revoke a token, and end the leases that were taken with it."""
    if not service.tokens.revoke(token):
        raise UnknownError(f"no token {token!r}", code="RID-TOKEN-UNKNOWN")
    service.audit.note(who.name, "revoked a token", details=token)
    for cell in service.leases.end_leases_of_token(token):
        service.audit.note(who.name, "ended the lease", cell, "its token was revoked")
    await service.database.wait_until_saved()


@router.post("/tickets", status_code=HTTPStatus.CREATED)
async def make_ticket(
    who: Who, request: Request, authenticator: Auth, wanted: Annotated[TicketCreation, Body()]
) -> NewTicket:
    """Create a ticket: `?ticket=` authorises one GET request of this path within 30 s."""
    secret = authenticator.secret_of(request.headers)
    if secret is None:
        raise NotKnownError(
            "this request for a ticket has no token: send your token", code="RID-TICKET-NO-TOKEN"
        )
    return NewTicket(ticket=authenticator.tickets.issue(secret, wanted.path))


@router.post("/pairing", status_code=HTTPStatus.CREATED)
async def begin_pairing(request: Request, authenticator: Auth) -> NewPairing:
    """Start pairing this device: it shows the code, and a person at the cell types it."""
    code, secret = authenticator.pairing.begin(
        "" if request.client is None else request.client.host
    )
    return NewPairing(code=code, secret=secret)


@router.post("/pairing/state")
async def pairing_state(
    query: Annotated[PairingQuery, Body()], authenticator: Auth, response: Response
) -> PairingState:
    """Return the state of this device's pairing; once confirmed, also its session secret."""
    secret = authenticator.pairing.collect(query.secret)
    if secret is None:
        return PairingState(confirmed=False)
    if not authenticator.secure:
        return PairingState(confirmed=True, key=secret)
    response.headers["set-cookie"] = authenticator.cookie(secret)
    return PairingState(confirmed=True)


@router.get("/pairing")
async def list_waiting(who: Administrator, authenticator: Auth) -> list[WaitingDevice]:
    """Return the waiting devices, without their codes."""
    return list(authenticator.pairing.waiting())


@router.post("/pairing/confirm", status_code=HTTPStatus.CREATED)
async def confirm_pairing(
    who: Administrator,
    authenticator: Auth,
    service: Service,
    confirmed: Annotated[PairingConfirmation, Body()],
) -> Token:
    """Grant access to the device that shows a code."""
    token = authenticator.pairing.confirm(confirmed.code, confirmed.name, confirmed.role, who.token)
    service.audit.note(who.name, "paired a device", details=f"{token.name}, {token.role.value}")
    return token


@router.get("/audit")
def list_audit(
    who: Administrator, service: Service, limit: Annotated[int, Query(ge=1, le=5000)] = 200
) -> list[AuditEntry]:
    """Return the user actions, newest first."""
    return list(service.audit.newest(limit))
