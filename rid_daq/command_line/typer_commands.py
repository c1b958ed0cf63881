"""The commands that are no operations yet: a line goes when its command becomes one."""

from __future__ import annotations

from typing import Final

from rid_daq.operations.catalogue import Entry

TYPER: Final = {
    "payload session": Entry(
        "payload_session", "", "lead through a session: check, warm up, record, identify, judge"
    ),
}
"""Every such command by its words: its module in `rid_daq.commands`, section and summary."""
