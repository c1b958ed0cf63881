"""What `rid-daq jog` does, and says of it."""

from __future__ import annotations

from rid_daq.commissioning.jog_job import JogRequest
from rid_daq.commissioning.jog_job import jog as jog_by_hand
from rid_daq.terminal.console import Console


def perform(request: JogRequest, console: Console) -> None:
    """Jog, and say how it ended; exit codes as the command has them."""
    run = jog_by_hand(request, console)
    console.document(run.document())
    run.print_verdict(console)
    if run.exit_code:
        raise SystemExit(run.exit_code)
