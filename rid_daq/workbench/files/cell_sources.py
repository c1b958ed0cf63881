"""`CellSource`: present content of a cell's file, line by line, with the line of an error."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rid_daq.service.served_cell import ServedCell

_PLACE = re.compile(r"(?:^|[\s/\\])([^\s/\\:]+):(\d+)(?::\d+)?: ")


@dataclass(frozen=True)
class CellSource:
    """A file of a cell.

    Attributes:
        name: Name of the file.
        lines: Its content.
        wrong_line: Number of the line with an error, from 1; None without an error.
        edit_path: Path in the service's folder, by which the file can be edited; empty for a file
            that cannot be edited in a browser.
    """

    name: str
    lines: Sequence[str]
    wrong_line: int | None
    edit_path: str


def sources_of(cell: ServedCell, folder: Path) -> tuple[CellSource, ...]:
    """Return the text files of a cell, with the line of the cell's error.

    Args:
        cell: The cell.
        folder: The service's folder; files outside it cannot be edited in a browser.
    """
    loaded = cell.reload_if_changed()
    place = _PLACE.search(cell.problem)
    found = []
    meshes = None if loaded.robot.meshes is None else loaded.robot.meshes.file
    for kept_name, kept in loaded.files.items():
        if kept_name == meshes:
            continue
        path, name, content, edit_path = loaded.disk_names.get(kept_name), kept_name, kept, ""
        if path is not None:
            path = path.resolve()
            name = path.name
            content = path.read_bytes() if path.is_file() else kept
            if path.is_relative_to(folder) and path.suffix == ".yaml":
                edit_path = str(path.relative_to(folder))
        wrong = int(place[2]) if place is not None and place[1] == name else None
        lines = content.decode("utf-8", errors="replace").splitlines()
        found.append(CellSource(name, lines, wrong, edit_path))
    return tuple(found)
