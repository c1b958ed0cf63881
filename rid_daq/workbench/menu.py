"""`MENU`: the pages of a cell, in the usual order of the work, with the operations of each page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rid_daq.operations.catalogue import CATALOGUE, GROUPS, operation


@dataclass(frozen=True)
class MenuEntry:
    """A page of a cell.

    Attributes:
        path: Part of its address after `/cells/CELL`; empty for the cell's own page.
        title: Title of the page.
        operations: Names of the operations that the page offers.
    """

    path: str
    title: str
    operations: tuple[str, ...] = ()


MENU: Final = (
    MenuEntry("", "Cell", ("check", "reset", "plate zero", "axes", "jog", "watch")),
    MenuEntry("/experiment", "Experiment", ("design", "record")),
    MenuEntry("/identify", "Identify", ("identify", "validate", "export")),
    MenuEntry("/friction", "Friction", ("friction",)),
    MenuEntry(
        "/payload",
        "Payload",
        ("payload session", "payload export", "payload read-back", "payload certificate"),
    ),
    MenuEntry(
        "/compensation",
        "Compensation",
        ("loop", "retime", "compensate", "tracking", "refine", "stream"),
    ),
    MenuEntry("/runs", "Runs", ("runs", "recover", "compare")),
    MenuEntry("/settings", "Settings"),
)


def command_links() -> dict[str, tuple[str, str]]:
    """Return path and text of a link by command; pages show the link instead of the command.

    A job without a button on a page of the menu has its own page. The first word of a group also
    selects its default operation.
    """
    pages = {name: entry.path for entry in MENU for name in entry.operations}
    found = {}
    for name, entry in CATALOGUE.items():
        if entry.is_job or name in pages:
            offered = operation(name)
            found[name] = (pages.get(name, f"/operations/{offered.kind}"), offered.label)
    for word, group in GROUPS.items():
        if (name := f"{word} {group.default}") in found:
            found[word] = found[name]
    return found
