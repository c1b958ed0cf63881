"""`token`: let a program or a device in to a service of this computer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from config.errors import ConfigError
from rid_daq.blocks.block import Text
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request


class TokenRequest(Request):
    """Make a token for a service of yours that runs on this computer.

    Without --code the token is printed, once: a program shows it (RID_DAQ_TOKEN). With --code the
    device that shows the code is let in. No token is needed for this: the owner of the service's
    folder can replace a lost administrator token.
    """

    name: Annotated[
        str,
        Field(description="Name in the list of tokens and in the log."),
        Option(positional=True),
    ]
    role: Annotated[Literal["viewer", "operator", "administrator"], Field(description="Role.")] = (
        "operator"
    )
    code: Annotated[
        str | None,
        Field(description="Let in the device that shows this code (default: a program)."),
        Option(metavar="DIGITS"),
    ] = None
    folder: Annotated[
        Path,
        Field(description="Folder of the service (default: the current one)."),
        Option(metavar="DIR"),
    ] = Path()


@dataclass(frozen=True)
class TokenResult:
    """A program or device that is let in.

    Attributes:
        secret: The token of a program; None for a device.
    """

    request: TokenRequest
    secret: str | None
    exit_code: int = 0

    def document(self) -> dict[str, object]:
        """Return name and role, and the token if there is one."""
        asked = self.request
        told: dict[str, object] = {"name": asked.name, "role": asked.role}
        return told if self.secret is None else {**told, "token": self.secret}

    def blocks(self) -> Iterator[Text]:
        """Yield the token, or that the device is let in."""
        asked = self.request
        if self.secret is None:
            yield Text(text=f"{asked.name} is let in as {asked.role}.")
            return
        yield Text(text=f"Token of {asked.name}, {asked.role}; it is shown only this once:")
        yield Text(text=self.secret)


def run(request: TokenRequest, _context: Context) -> TokenResult:
    """Ask the service for a token, or confirm the code of a device."""
    from rid_daq.service.client import ServiceClient
    from rid_daq.service.sockets import socket_of

    socket = socket_of(request.folder)
    if not socket.is_socket():
        raise ConfigError(
            f"{request.folder.resolve()}: no service of yours runs in this folder; give its"
            " --folder, or start it: `rid-daq serve`",
            code="RID-TOKEN-NO-SERVICE",
        )
    wanted = {"name": request.name, "role": request.role}
    with ServiceClient.at(str(socket)) as service:
        if request.code is None:
            made = service.ask("POST", "/tokens", wanted)
            return TokenResult(request, str(made["secret"]))
        code = request.code.replace(" ", "")
        service.ask("POST", "/pairing/confirm", {**wanted, "code": code})
        return TokenResult(request, None)


OPERATION: Final = Operation(
    name="token",
    label="Let a program in",
    request=TokenRequest,
    run=run,
    examples=("token plotter --role viewer", "token tablet --code 123456 --folder lab"),
)
