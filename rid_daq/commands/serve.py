"""`rid-daq serve`: cells as a service, with a workbench in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rid_daq.terminal.console import Console
from rid_daq.terminal.options import DEFAULT_LISTEN, AsJson


def serve(
    cells: Annotated[
        list[str], typer.Argument(metavar="CELL...", help="Bundled names or cell files.")
    ],
    folder: Annotated[
        Path,
        typer.Option(
            "--folder",
            metavar="DIR",
            help="Where runs, motions and models lie, and the service keeps its jobs.",
        ),
    ] = Path(),
    listen: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS:PORT",
            help="Where pages are served; an address that other machines can reach needs"
            " --certificate.",
        ),
    ] = DEFAULT_LISTEN,
    certificate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Certificate and key (PEM): pages by TLS."),
    ] = None,
    pace: Annotated[
        float,
        typer.Option(
            min=0.1,
            max=20.0,
            metavar="TIMES",
            help="How many times the clock's pace simulated cells keep.",
        ),
    ] = 1.0,
    install: Annotated[
        bool,
        typer.Option(
            "--install",
            help="Write a systemd unit that serves this at every start of the computer, and end.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Serve cells: state, jobs and runs to browsers and programs, until Ctrl-C or SIGTERM.

    Jobs run in processes of their own; a stop needs no living service (`rid-daq stop`). At the end
    what moves is stopped and the drives are switched off. Only this computer is served unless
    --listen and --certificate say otherwise; new devices are let in by a code that somebody
    confirms.
    """
    from rid_daq.service.hosting import ServeRequest, serve_cells
    from rid_daq.service.logs import LOG, log_to_stderr
    from rid_daq.service.systemd_unit import SystemdUnit
    from rid_daq.web.access import Access
    from rid_daq.workbench.pages import PAGES

    console = Console(as_json)
    request = ServeRequest(tuple(cells), folder, Access.of_service(listen, certificate), pace)
    paths = [str(Path(cell).resolve()) if Path(cell).is_file() else cell for cell in cells]
    arguments = [*paths, "--folder", str(folder.resolve()), "--listen", listen]
    arguments += ["--pace", f"{pace:g}"]
    arguments += [] if certificate is None else ["--certificate", str(certificate.resolve())]
    unit = SystemdUnit.of(cells, folder, arguments)
    if install:
        then = unit.install()
        console.document({"unit": str(unit.path), "next": then})
        console.say(f"Wrote {unit.path}")
        console.say(f"Next: {then}")
        return
    log_to_stderr()
    if unit.keep_current():
        LOG.warning("wrote %s anew; run systemctl daemon-reload", unit.path)

    def ready(link: str, address: Path) -> None:
        console.document({"url": link, "socket": str(address), "cells": cells})
        console.say(f"Workbench: {link}")
        console.say("Its stop button is software, not an emergency stop. Ctrl-C ends the service.")

    serve_cells(request, PAGES, ready)
