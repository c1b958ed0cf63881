"""`StopDesk`: who may stop, and what they are told. It needs memory alone, and waits for nothing.

A stop too many costs a run, one too few may cost an arm: so everybody on this computer may stop,
and elsewhere whoever shows a secret that was ever issued.
"""

from __future__ import annotations

from collections.abc import Mapping

from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.logs import LOG
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_answer import ALL, StopAsked, stop_each, unknown_stopper
from rid_daq.web.access import is_loopback


class StopDesk:
    """Takes requests to stop, in the service's own process.

    Args:
        service: The cells.
        door: Who is who.
    """

    def __init__(self, service: CellService, door: Doorkeeper) -> None:
        self._service = service
        self._door = door

    def admit(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return the name of who asks.

        Args:
            headers: Of the request, by lower-case name.
            local: Whether it came by a Unix socket.
            address: The client's IP address; empty if there is none.

        Raises:
            NotKnownError: They ask from another computer and show no secret that was ever issued.
        """
        who = self._door.look(headers, local=local)
        if who is not None:
            return who.name
        if self._door.was_let_in(headers):
            return "somebody with an old token"
        if local or is_loopback(address):
            return "somebody"
        raise unknown_stopper()

    def stop(self, target: str, who: str) -> StopAsked:
        """Stop a cell, or all of them (`ALL`).

        Raises:
            UnknownError: There is no such cell.
        """
        names = list(self._service.cells) if target == ALL else [self._service.cell(target).name]
        return stop_each(
            names,
            lambda name: self._service.stop(name, who),
            lambda name: LOG.exception("cell %s: the stop by %s went wrong", name, who),
        )
