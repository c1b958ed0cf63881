"""`serve`: serve cells to browsers and programs, with the workbench."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import Text
from rid_daq.operations.end_result import EndResult
from rid_daq.operations.operation import Context, Operation, OperationResult
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import DEFAULT_LISTEN

if TYPE_CHECKING:
    from rid_daq.service.systemd_unit import SystemdUnit


class ServeRequest(Request):
    """Serve cells to browsers and programs until Ctrl-C or SIGTERM: state, jobs and runs.

    Jobs run in their own processes; `rid-daq stop` works even if the service has died. At the end
    all motion is stopped and the drives are switched off. Only this computer can connect unless
    --listen and --certificate are given; a new device gets access with a code that a person
    confirms.
    """

    cells: Annotated[
        tuple[str, ...],
        Field(min_length=1, description="Cells to serve: bundled names or cell files."),
        Option(positional=True, metavar="CELL..."),
    ]
    folder: Annotated[
        Path,
        Field(
            description="Folder of runs, motions, models and the service's jobs (default: the"
            " current folder)."
        ),
        Option(metavar="DIR"),
    ] = Path()
    listen: Annotated[
        str,
        Field(
            description="Address of the workbench; an address that other computers can reach"
            " needs --certificate."
        ),
        Option(metavar="ADDRESS:PORT"),
    ] = DEFAULT_LISTEN
    certificate: Annotated[
        Path | None,
        Field(description="Certificate and key (PEM) to serve the workbench by TLS."),
        Option(metavar="FILE"),
    ] = None
    pace: Annotated[
        float,
        Field(ge=0.1, le=20.0, description="Run simulated cells at N times real time."),
        Option(metavar="N"),
    ] = 1.0
    install: Annotated[
        bool,
        Field(
            description="Write a systemd unit that starts this service, and end. A unit of root"
            " starts with the computer, that of another user when this user logs in."
        ),
    ] = False

    @property
    def arguments(self) -> list[str]:
        """Arguments of `rid-daq serve` that start the same service from any folder."""
        cells = [str(Path(cell).resolve()) if Path(cell).is_file() else cell for cell in self.cells]
        words = [*cells, "--folder", str(self.folder.resolve()), "--listen", self.listen]
        words += ["--pace", f"{self.pace:g}"]
        certificate = self.certificate
        return (
            words if certificate is None else [*words, "--certificate", str(certificate.resolve())]
        )


@dataclass(frozen=True)
class WrittenUnit:
    """A systemd unit that was written, and the command that starts it."""

    unit: Path
    next: str

    def document(self) -> dict[str, object]:
        """Return the path of the systemd unit and the command that starts it."""
        return {"unit": str(self.unit), "next": self.next}

    def blocks(self) -> Iterator[Text]:
        """Yield the path of the systemd unit and the command that starts it."""
        yield Text(text=f"Wrote {self.unit}")
        yield Text(text=f"Next: {self.next}")


@dataclass(frozen=True)
class ServiceReady:
    """A running service.

    Attributes:
        url: Address of its workbench.
        socket: Socket for programs of this computer.
        cells: Cells that are served.
    """

    url: str
    socket: Path
    cells: tuple[str, ...]

    def document(self) -> dict[str, object]:
        """Return the addresses and the cells."""
        return {"url": self.url, "socket": str(self.socket), "cells": list(self.cells)}

    def blocks(self) -> Iterator[Text]:
        """Yield the address of the workbench."""
        yield Text(text=f"Workbench: {self.url}")
        yield Text(
            text="The stop button of the workbench is software, not an emergency stop. Ctrl-C"
            " ends the service."
        )


def run(request: ServeRequest, context: Context) -> OperationResult:
    """Serve the cells until a signal, or write the systemd unit."""
    from rid_daq.service.hosting import serve_cells
    from rid_daq.service.logs import log_to_stderr
    from rid_daq.service.systemd_unit import SystemdUnit
    from rid_daq.web.access import Access
    from rid_daq.workbench.pages import PAGES
    from rid_daq.workbench.static_files import static_version

    static_version()  # refuse an incomplete installation before anything starts
    access = Access.of_service(request.listen, request.certificate)
    unit = SystemdUnit.of(request.cells, request.folder, request.arguments)
    if request.install:
        return WrittenUnit(unit.path, unit.install())
    log_to_stderr()
    _update_unit(unit)

    def ready(link: str, address: Path) -> None:
        begun = ServiceReady(link, address, request.cells)
        context.result(begun.document(), begun.blocks())

    serve_cells(request.cells, request.folder, access, request.pace, PAGES, ready)
    return EndResult()


def _update_unit(unit: SystemdUnit) -> None:
    from rid_daq.service.logs import LOG

    if unit.keep_current():
        LOG.warning(
            "%s was written again because it was out of date; run systemctl daemon-reload",
            unit.path,
        )


OPERATION: Final = Operation(
    name="serve",
    label="Service",
    request=ServeRequest,
    run=run,
    examples=(
        "serve ir361 --folder lab",
        "serve cell.yaml --listen 192.168.1.5:8642 --certificate service.pem",
    ),
    opens_cell=True,
    moves=True,
    module="rid_daq.service.hosting",
)
