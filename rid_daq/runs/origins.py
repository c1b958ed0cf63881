"""`Origins`: which files a run's copies were made from, and in which line of them a key stands.

A run keeps copies of cell, robot and map. Who has to change a key changes the file that the copy
was made from: it is found again by its path, and compared by its SHA-256.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.json_file import read_json_file
from config.formats.yaml_tree import MAX_BYTES, YamlTree, parse_yaml
from config.load import LoadedCell, read_named
from config.model import ConfigModel
from rid_daq.runs.run_data import CELL, MAP, ORIGINS, ROBOT

_BUNDLED: Final = " (bundled)"
_KINDS: Final = {CELL: "cells", ROBOT: "robots", MAP: "maps"}
_SHOWN: Final = 80
_ORIGINS_BYTES: Final = 100_000

Path_ = tuple[str | int, ...]


class Origin(ConfigModel):
    """A file that a run's copy was made from: its path, or the name of a bundled one."""

    file: str
    sha256: str

    @property
    def is_bundled(self) -> bool:
        """Whether it comes with the program."""
        return self.file.endswith(_BUNDLED)


class _Document(ConfigModel):
    kind: Literal["rid-daq origins"] = "rid-daq origins"
    files: dict[str, Origin]


@dataclass(frozen=True)
class FileLine:
    """Where a key stands, or where it is to be put.

    Attributes:
        line: Counted from 1; where the key is not stated, what it belongs to begins there.
        stated: Whether the key stands there; else it is to be added.
        text: What the line says, where the key is stated and the file is still the same.
        remark: What a person should know of the file; empty where it is the one that the run was
            made with.
    """

    file: str
    line: int
    key: str
    stated: bool
    text: str | None
    remark: str

    def __str__(self) -> str:
        """Return the line as people and editors read it."""
        says = self.text or (self.key if self.stated else f"add {self.key}")
        return f"{self.file}:{self.line}: {says}" + (f" ({self.remark})" if self.remark else "")


def note_cell(folder: RunFolder, loaded: LoadedCell) -> None:
    """Write down which files a run's cell and robot were.

    Raises:
        RecordingError: It cannot be written.
    """
    if loaded.path is None:
        files = {CELL: f"{loaded.config.name}.yaml{_BUNDLED}"}
        files[ROBOT] = f"{loaded.config.robot}.yaml{_BUNDLED}"
    else:
        files = {CELL: str(loaded.path.absolute())}
        robot = _robot_of(loaded)
        files |= {} if robot is None else {ROBOT: robot}
    _note(folder, {name: (file, loaded.files[name]) for name, file in files.items()})


def note_map(folder: RunFolder, reference: str) -> None:
    """Write down which files an imported run's map and robot were.

    Raises:
        ConfigError: They cannot be read any more.
        RecordingError: It cannot be written.
    """
    text, shown, beside = read_named(reference, "maps", None)
    found = {MAP: (_absolute(shown), text)}
    robot = parse_yaml(text, shown).data["robot"]
    text, shown, _ = read_named(robot, "robots", beside)
    _note(folder, found | {ROBOT: (_absolute(shown), text)})


def cell_of(folder: RunFolder, unknown: str = "CELL") -> str:
    """Return the cell of a run as commands take it: a bundled name, or the file's path.

    `unknown` where no run says it, or the file is gone.

    Raises:
        RecordingError: The run cannot be read.
    """
    origin = _origins(folder).get(CELL)
    if origin is None:
        return unknown
    if origin.is_bundled:
        return origin.file.removesuffix(_BUNDLED).removesuffix(".yaml")
    return origin.file if Path(origin.file).is_file() else unknown


def _origins(folder: RunFolder) -> dict[str, Origin]:
    known = folder.file(ORIGINS)
    if not known.exists():
        return {}
    wanted = "the origins of a run's files"
    return read_json_file(known, _Document, _ORIGINS_BYTES, wanted).files


def key_lines(
    folder: RunFolder, places: Iterable[str], joint_names: Sequence[str]
) -> tuple[FileLine, ...]:
    """Return in which lines of which files keys of a run stand; those not found are left out.

    Args:
        folder: The run.
        places: Name of the run's copy, and the path of keys and indices: `cell.yaml
            axes.1.direction`.
        joint_names: The robot's joints, which a map of messages calls by their names.

    Raises:
        RecordingError: The run cannot be read.
    """
    origins = _origins(folder)

    @cache
    def source(name: str) -> tuple[YamlTree, list[str], str]:
        return _source(folder, name, origins.get(name))

    found = {}
    for place in places:
        name, _, dotted = place.partition(" ")
        if not folder.file(name).exists():
            continue
        path = tuple(int(part) if part.isdigit() else part for part in dotted.split("."))
        tree, lines, remark = source(name)
        line = _line(tree, lines, _of_messages(tree.data, path, joint_names), remark)
        found[line.file, line.line, line.key] = line
    return tuple(found.values())


def _note(folder: RunFolder, files: dict[str, tuple[str, bytes]]) -> None:
    document = _Document(
        files={
            name: Origin(file=file, sha256=hashlib.sha256(text).hexdigest())
            for name, (file, text) in files.items()
        }
    )
    folder.write(ORIGINS, (document.model_dump_json(indent=1) + "\n").encode())


def _robot_of(loaded: LoadedCell) -> str | None:
    """Return which file a cell's robot is, by its bytes; None where it is none that is there."""
    assert loaded.path is not None
    beside = loaded.path.parent
    for reference in (loaded.config.robot, str(beside.absolute() / ROBOT)):
        try:
            text, shown, _ = read_named(reference, "robots", beside)
        except ConfigError:
            continue
        if text == loaded.files[ROBOT]:
            return _absolute(shown)
    return None


def _absolute(shown: str) -> str:
    return shown if shown.endswith(_BUNDLED) else str(Path(shown).expanduser().absolute())


def _source(folder: RunFolder, name: str, origin: Origin | None) -> tuple[YamlTree, list[str], str]:
    """Return the file to change, its lines as far as they may be shown, and what to know of it."""
    kept, copy = folder.read(name), str(folder.file(name))
    if origin is None:
        return _parsed(kept, copy, "the run's copy")
    if origin.is_bundled:
        text = _bundled(origin, name) or kept
        return _parsed(text, origin.file, "comes with rid-daq: use a copy of your own")
    try:
        text = read_file(Path(origin.file), MAX_BYTES)
        same = hashlib.sha256(text).hexdigest() == origin.sha256
        tree, lines, _ = _parsed(text, origin.file, "")
    except (OSError, ConfigError):
        return _parsed(kept, copy, f"the run's copy; {origin.file} cannot be read any more")
    return tree, lines if same else [], "" if same else "changed since the run"


def _bundled(origin: Origin, name: str) -> bytes | None:
    stem = origin.file.removesuffix(_BUNDLED).removesuffix(".yaml")
    try:
        return read_named(stem, _KINDS[name], None)[0]
    except ConfigError:
        return None


def _parsed(text: bytes, shown: str, remark: str) -> tuple[YamlTree, list[str], str]:
    lines = text.decode("utf-8-sig", errors="replace").splitlines()
    return parse_yaml(text, shown), lines, remark


def _line(tree: YamlTree, lines: list[str], path: Path_, remark: str) -> FileLine:
    depth = next(n for n in range(len(path), -1, -1) if path[:n] in tree.positions)
    number = tree.positions[path[:depth]][0]
    stated = depth == len(path)
    words = [part for part in (path if stated else path[depth:]) if isinstance(part, str)]
    key = words[-1] if stated else ".".join(words)
    text = lines[number - 1].strip() if stated and number <= len(lines) else None
    if text is not None and len(text) > _SHOWN:
        text = f"{text[:_SHOWN]}…"
    return FileLine(tree.name, number, key, stated, text, remark)


def _of_messages(data: Any, path: Path_, joint_names: Sequence[str]) -> Path_:
    """Return the path of a key in a map of messages, which names only the joints that differ."""
    states = data.get("joint_states")
    if states is None or path[0] not in ("joints", "time", "rate_hz"):
        return path
    if path[0] != "joints":
        return ("joint_states", *path)
    number, key = path[1:]
    if key in ("position", "torque", "current"):
        return ("joint_states", "names", number)
    listed = [each["joint"] for each in states.get("joints", ())]
    name = joint_names[int(number)]
    return ("joint_states", "joints", listed.index(name) if name in listed else name, key)
