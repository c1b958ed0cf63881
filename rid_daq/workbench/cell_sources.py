"""`CellSource`: present content of a cell's file, line by line, with the line of an error."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rid_daq.service.served_cell import ServedCell

_PLACE = re.compile(r"(?:^|[\s/\\])([^\s/\\:]+):(\d+)(?::\d+)?: ")


@dataclass(frozen=True)
class CellSource:
    """A file of a cell.

    Attributes:
        name: Name of the file.
        lines: Its content.
        wrong_line: Number of the line with an error, from 1; None without an error.
    """

    name: str
    lines: Sequence[str]
    wrong_line: int | None


def sources_of(cell: ServedCell) -> tuple[CellSource, ...]:
    """Return the text files of a cell, with the line of the cell's error."""
    loaded = cell.reload_if_changed()
    place = _PLACE.search(cell.problem)
    found = []
    meshes = None if loaded.robot.meshes is None else loaded.robot.meshes.file
    for name, content in loaded.files.items():
        if name == meshes:
            continue
        path = None if loaded.path is None else loaded.path.resolve().parent / name
        if path is not None and path.is_file():
            content = path.read_bytes()
        wrong = int(place[2]) if place is not None and place[1] == name else None
        lines = content.decode("utf-8", errors="replace").splitlines()
        found.append(CellSource(name, lines, wrong))
    return tuple(found)
