"""`ServiceStopHandler`: executes STOP requests in the service's process; waits for no database.

An unnecessary stop costs a recording; a missing stop can damage the robot. Every program on this
computer may therefore stop. From other computers, every sender may stop whose request contains a
secret that was ever issued.
"""

from __future__ import annotations

from collections.abc import Mapping

from rid_daq.service.authenticator import Authenticator
from rid_daq.service.logs import LOG
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_answer import ALL, StopAnswer, stop_each, unknown_sender_error
from rid_daq.web.access import is_loopback


class ServiceStopHandler:
    """Executes STOP requests in the service's process.

    Args:
        service: Service whose cells are stopped.
        authenticator: Identifies the senders of requests.
    """

    def __init__(self, service: CellService, authenticator: Authenticator) -> None:
        self._service = service
        self._authenticator = authenticator

    def identify_sender(self, headers: Mapping[str, str], *, local: bool, address: str) -> str:
        """Return the name of the sender of a request.

        Args:
            headers: Headers of the request, by lower-case name.
            local: True if the request arrived through a Unix socket.
            address: IP address of the client; empty for a Unix socket.

        Raises:
            NotKnownError: The sender is on another computer, and the request contains no secret
                that was ever issued.
        """
        who = self._authenticator.find_identity(headers, local=local)
        if who is not None:
            return who.name
        if self._authenticator.has_issued_secret(headers):
            return "a user with a revoked token"
        if local or is_loopback(address):
            return "a user"
        raise unknown_sender_error()

    def stop(self, target: str, who: str) -> StopAnswer:
        """Stop a cell, or all cells (`ALL`).

        Raises:
            UnknownError: The service has no such cell.
        """
        names = list(self._service.cells) if target == ALL else [self._service.cell(target).name]
        return stop_each(
            names,
            lambda name: self._service.stop(name, who),
            lambda name: LOG.exception("cell %s: the stop by %s failed", name, who),
        )
