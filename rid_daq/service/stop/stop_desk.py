"""`StopDesk`: who may stop, and what they are told. It needs memory alone, and waits for nothing.

A stop too many costs a run, one too few may cost an arm: so everybody on this computer may stop,
and elsewhere whoever shows a secret that was ever issued.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from typing import Final

from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.logs import LOG
from rid_daq.service.records import Record
from rid_daq.service.refusals import NotKnownError
from rid_daq.service.service import CellService

ALL: Final = "*"
"""The name that stands for every cell of the service."""


class StopAsked(Record):
    """Whether something was told to stop; and what to do where nothing was."""

    told: bool
    sentence: str


class StopDesk:
    """Takes requests to stop.

    Parameters
    ----------
    service : CellService
        The cells.
    door : Doorkeeper
        Who is who.
    """

    def __init__(self, service: CellService, door: Doorkeeper) -> None:
        self._service = service
        self._door = door

    def admit(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return the name of who asks.

        Parameters
        ----------
        headers
            Of the request, by lower-case name.
        local : bool
            Whether it came by a Unix socket.
        address : str
            The client's IP address; empty if there is none.

        Raises
        ------
        NotKnownError
            They ask from another computer and show no secret that was ever issued.
        """
        who = self._door.look(headers, local=local)
        if who is not None:
            return who.name
        if self._door.was_let_in(headers):
            return "somebody with an old token"
        if local or is_loopback(address):
            return "somebody"
        raise NotKnownError(
            "show a token to stop from another computer; or press the stop there",
            code="RID-STOP-UNKNOWN",
        )

    def stop(self, target: str, who: str) -> StopAsked:
        """Stop a cell, or all of them (`ALL`).

        Raises
        ------
        UnknownError
            There is no such cell.
        """
        names = list(self._service.cells) if target == ALL else [self._service.cell(target).name]
        told, failed = False, []
        for name in names:
            try:
                told = self._service.stop(name, who) or told
            except Exception:  # the other cells are stopped all the same
                LOG.exception("cell %s: the stop by %s went wrong", name, who)
                failed.append(name)
        if failed:
            cells = ", ".join(failed)
            sentence = f"Cell {cells} could not be told to stop: use the emergency stop."
        elif told:
            sentence = "Stop asked for: watch that the axes come to rest."
        else:
            sentence = "Nothing moves here by this service."
        return StopAsked(told=told, sentence=sentence)


def is_loopback(address: str) -> bool:
    """Return whether an IP address is one of this computer's own."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(found, "ipv4_mapped", None)
    return found.is_loopback or (mapped is not None and mapped.is_loopback)
