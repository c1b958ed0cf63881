"""`token`: make a token for a program or device that uses a service of this computer."""

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
    """Give a program or device access to a service that you run on this computer.

    Without --code, a token is made and printed once; a program reads it from RID_DAQ_TOKEN. With
    --code, the device that shows the code gets access. This command itself needs no token, so the
    owner of the service's folder can replace a lost administrator token.
    """

    name: Annotated[
        str,
        Field(description="Name of the program or device, for the list of tokens and the log."),
        Option(positional=True),
    ]
    role: Annotated[
        Literal["viewer", "operator", "administrator"],
        Field(description="Role of the program or device."),
    ] = "operator"
    code: Annotated[
        str | None,
        Field(
            description="Give access to the device that shows this code (default: make a token"
            " for a program)."
        ),
        Option(metavar="DIGITS"),
    ] = None
    folder: Annotated[
        Path,
        Field(description="Folder of the service (default: the current folder)."),
        Option(metavar="DIR"),
    ] = Path()


@dataclass(frozen=True)
class TokenResult:
    """A program or device that got access.

    Attributes:
        secret: Token of a program; None for a device.
    """

    request: TokenRequest
    secret: str | None

    def document(self) -> dict[str, object]:
        """Return name and role, and the token of a program."""
        asked = self.request
        document: dict[str, object] = {"name": asked.name, "role": asked.role}
        return document if self.secret is None else {**document, "token": self.secret}

    def blocks(self) -> Iterator[Text]:
        """Yield the token, or a sentence that the device has access."""
        asked = self.request
        if self.secret is None:
            yield Text(text=f"{asked.name} has access as {asked.role}.")
            return
        yield Text(text=f"Token of {asked.name}, {asked.role}; it is shown only once:")
        yield Text(text=self.secret)


def run(request: TokenRequest, _context: Context) -> TokenResult:
    """Request a token from the service, or confirm the code of a device."""
    from rid_daq.service.client import ServiceClient
    from rid_daq.service.sockets import socket_path_of

    socket = socket_path_of(request.folder)
    if not socket.is_socket():
        raise ConfigError(
            f"{request.folder.resolve()}: you run no service in this folder; give the service's"
            " folder with --folder, or start a service with `rid-daq serve`",
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
    label="Give a program access",
    request=TokenRequest,
    run=run,
    examples=("token plotter --role viewer", "token tablet --code 123456 --folder lab"),
    is_of_cells=True,
)
