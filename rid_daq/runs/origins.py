"""Source files of the cell, robot and map of a run, and the lines with keys in these files.

A run stores copies of the files. To change a key, a person changes the source file, not the copy.
The run stores path and SHA-256 of each source file, to find it and to detect changes.
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
    """Source file of a run's copy: its path, or the name of a bundled file."""

    file: str
    sha256: str

    @property
    def is_bundled(self) -> bool:
        """True if the file is bundled with the program."""
        return self.file.endswith(_BUNDLED)


class _Document(ConfigModel):
    kind: Literal["rid-daq origins"] = "rid-daq origins"
    files: dict[str, Origin]


@dataclass(frozen=True)
class FileLine:
    """Line of a file that contains a key, or at which the key must be added.

    Attributes:
        line: Line number from 1; if the key is missing, the first line of its parent.
        stated: True if the file contains the key; otherwise it must be added.
        text: Text of the line, if the file contains the key and is unchanged.
        remark: Note on the file; empty if it is unchanged since the run.
    """

    file: str
    line: int
    key: str
    stated: bool
    text: str | None
    remark: str

    def __str__(self) -> str:
        """Return the line in the format of editors, `file:line: text`."""
        says = self.text or (self.key if self.stated else f"add {self.key}")
        return f"{self.file}:{self.line}: {says}" + (f" ({self.remark})" if self.remark else "")


def write_cell_origin(folder: RunFolder, loaded: LoadedCell) -> None:
    """Write path and SHA-256 of the cell's and the robot's source file into the run folder.

    Raises:
        RecordingError: The file cannot be written.
    """
    if loaded.path is None:
        files = {CELL: f"{loaded.config.name}.yaml{_BUNDLED}"}
        files[ROBOT] = f"{loaded.config.robot}.yaml{_BUNDLED}"
    else:
        files = {CELL: str(loaded.path.absolute())}
        robot = _robot_file(loaded)
        files |= {} if robot is None else {ROBOT: robot}
    _write_origins(folder, {name: (file, loaded.files[name]) for name, file in files.items()})


def write_map_origin(folder: RunFolder, reference: str) -> None:
    """Write path and SHA-256 of the map's and the robot's source file into an imported run.

    Raises:
        ConfigError: The source files cannot be read any more.
        RecordingError: The file cannot be written.
    """
    text, shown, beside = read_named(reference, "maps", None)
    found = {MAP: (_absolute_path(shown), text)}
    robot = parse_yaml(text, shown).data["robot"]
    text, shown, _ = read_named(robot, "robots", beside)
    _write_origins(folder, found | {ROBOT: (_absolute_path(shown), text)})


def cell_argument(folder: RunFolder, unknown: str = "CELL") -> str:
    """Return the cell of a run as a command's argument: a bundled name, or the file's path.

    Return `unknown` if the run does not name its cell, or the file no longer exists.

    Raises:
        ConfigError, RecordingError: The run cannot be read.
    """
    origin = _read_origins(folder).get(CELL)
    if origin is None:
        return unknown
    if origin.is_bundled:
        return origin.file.removesuffix(_BUNDLED).removesuffix(".yaml")
    return origin.file if Path(origin.file).is_file() else unknown


def _read_origins(folder: RunFolder) -> dict[str, Origin]:
    known = folder.file(ORIGINS)
    if not known.exists():
        return {}
    wanted = "the origins of a run's files"
    return read_json_file(known, _Document, _ORIGINS_BYTES, wanted).files


def key_lines(
    folder: RunFolder, places: Iterable[str], joint_names: Sequence[str]
) -> tuple[FileLine, ...]:
    """Return the lines that contain given keys in the source files of a run.

    Keys of a file that the run does not have are skipped.

    Args:
        folder: The run.
        places: For each key, the name of the run's copy and the path to the key in it, such as
            `cell.yaml axes.1.direction`; a number is an index in a list.
        joint_names: Joints of the robot; a map of messages refers to joints by name.

    Raises:
        ConfigError, RecordingError: The run cannot be read.
    """
    origins = _read_origins(folder)

    @cache
    def source(name: str) -> tuple[YamlTree, list[str], str]:
        return _source_lines(folder, name, origins.get(name))

    found = {}
    for place in places:
        name, _, dotted = place.partition(" ")
        if not folder.file(name).exists():
            continue
        path = tuple(int(part) if part.isdigit() else part for part in dotted.split("."))
        tree, lines, remark = source(name)
        line = _find_line(tree, lines, _path_in_message_map(tree.data, path, joint_names), remark)
        found[line.file, line.line, line.key] = line
    return tuple(found.values())


def _write_origins(folder: RunFolder, files: dict[str, tuple[str, bytes]]) -> None:
    document = _Document(
        files={
            name: Origin(file=file, sha256=hashlib.sha256(text).hexdigest())
            for name, (file, text) in files.items()
        }
    )
    folder.write(ORIGINS, (document.model_dump_json(indent=1) + "\n").encode())


def _robot_file(loaded: LoadedCell) -> str | None:
    """Return the source file of a cell's robot, found by its bytes; None if none is found."""
    assert loaded.path is not None
    beside = loaded.path.parent
    for reference in (loaded.config.robot, str(beside.absolute() / ROBOT)):
        try:
            text, shown, _ = read_named(reference, "robots", beside)
        except ConfigError:
            continue
        if text == loaded.files[ROBOT]:
            return _absolute_path(shown)
    return None


def _absolute_path(shown: str) -> str:
    return shown if shown.endswith(_BUNDLED) else str(Path(shown).expanduser().absolute())


def _source_lines(
    folder: RunFolder, name: str, origin: Origin | None
) -> tuple[YamlTree, list[str], str]:
    """Return content, lines and a note of the file to change, or of the run's copy.

    There are no lines if the file has changed since the run: they would not match the key.
    """
    kept, copy = folder.read(name), str(folder.file(name))
    if origin is None:
        return _parse_lines(kept, copy, "the run's copy")
    if origin.is_bundled:
        text = _read_bundled(origin, name) or kept
        return _parse_lines(text, origin.file, "bundled with rid-daq: make your own copy")
    try:
        text = read_file(Path(origin.file), MAX_BYTES)
        same = hashlib.sha256(text).hexdigest() == origin.sha256
        tree, lines, _ = _parse_lines(text, origin.file, "")
    except (OSError, ConfigError):
        return _parse_lines(kept, copy, f"the run's copy; {origin.file} can no longer be read")
    return tree, lines if same else [], "" if same else "changed since the run"


def _read_bundled(origin: Origin, name: str) -> bytes | None:
    stem = origin.file.removesuffix(_BUNDLED).removesuffix(".yaml")
    try:
        return read_named(stem, _KINDS[name], None)[0]
    except ConfigError:
        return None


def _parse_lines(text: bytes, shown: str, remark: str) -> tuple[YamlTree, list[str], str]:
    lines = text.decode("utf-8-sig", errors="replace").splitlines()
    return parse_yaml(text, shown), lines, remark


def _find_line(tree: YamlTree, lines: list[str], path: Path_, remark: str) -> FileLine:
    depth = next(n for n in range(len(path), -1, -1) if path[:n] in tree.positions)
    number = tree.positions[path[:depth]][0]
    stated = depth == len(path)
    words = [part for part in (path if stated else path[depth:]) if isinstance(part, str)]
    key = words[-1] if stated else ".".join(words)
    text = lines[number - 1].strip() if stated and number <= len(lines) else None
    if text is not None and len(text) > _SHOWN:
        text = f"{text[:_SHOWN]}…"
    return FileLine(tree.name, number, key, stated, text, remark)


def _path_in_message_map(data: Any, path: Path_, joint_names: Sequence[str]) -> Path_:
    """Return the path of a key in a map of messages, which lists only some joints."""
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
