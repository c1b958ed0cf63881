"""`rid-daq token`: let a program or a device in to a service of this computer."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import AsJson


class RoleChoice(StrEnum):
    """What the program or device may do."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMINISTRATOR = "administrator"


def token(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name in the list of tokens and in the log.")
    ],
    role: Annotated[RoleChoice, typer.Option(help="Role.")] = RoleChoice.OPERATOR,
    code: Annotated[
        str | None,
        typer.Option(
            metavar="DIGITS", help="Let in the device that shows this code (default: a program)."
        ),
    ] = None,
    folder: Annotated[
        Path, typer.Option("--folder", metavar="DIR", help="Folder of the service.")
    ] = Path(),
    as_json: AsJson = False,
) -> None:
    """Make a token for a service of yours that runs on this computer.

    Without --code the token is printed, once: a program shows it (RID_DAQ_TOKEN). With --code the
    device that shows the code is let in. Nobody needs to be let in already: whoever owns the
    service's folder replaces a lost administrator token so.
    """
    from rid_daq.service.client import ServiceClient
    from rid_daq.service.sockets import socket_of

    console = Console(as_json)
    socket = socket_of(folder)
    if not socket.is_socket():
        raise ConfigError(
            f"{folder.resolve()}: no service of yours runs in this folder; give its --folder, or"
            " start it: `rid-daq serve`",
            code="RID-TOKEN-NO-SERVICE",
        )
    wanted = {"name": name, "role": role.value}
    with ServiceClient.at(str(socket)) as service:
        if code is not None:
            service.ask("POST", "/pairing/confirm", {**wanted, "code": code.replace(" ", "")})
            console.document(wanted)
            console.say(f"{name} is let in as {role.value}.")
            return
        made = service.ask("POST", "/tokens", wanted)
    console.document({**wanted, "token": made["secret"]})
    console.say(f"Token of {name}, {role.value}; it is shown this once:")
    console.say(str(made["secret"]))
