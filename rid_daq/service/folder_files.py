"""`folder_files`: the motions, models and other files of a service's folder, by what they are."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from acquisition.motion.motion_file import MOTION_KINDS
from rid_daq.service.records import FilesOfCell, NamedFile
from rid_daq.service.service import CellService

HEAD_BYTES: Final = 4096
_KINDS: Final = "|".join(sorted(MOTION_KINDS, key=len, reverse=True))
_MOTION = re.compile(rf"^kind:\s*[\"']?({_KINDS})\b".encode(), re.MULTILINE)
_ROBOT = re.compile(rb"^robot:\s*[\"']?([\w.-]+)", re.MULTILINE)
_JSON: Final = (
    (b'"rid-daq estimate"', "models"),
    (b'"rid-daq velocity loops 1"', "loops"),
    (b'"rid-daq feedforward 1"', "feedforwards"),
    (b'"rid-daq payload"', "payloads"),
)
_OF_A_ROBOT: Final = frozenset({"models", "payloads"})
_NOT_CHOSEN: Final = frozenset({"manifest.json", "result.json", "session.json"})


def folder_files(service: CellService, robot: str) -> FilesOfCell:
    """Return the files of a service's folder, newest first; of runs, what commands put there.

    Parameters
    ----------
    service : CellService
        The service.
    robot : str
        The name of the cell's robot; what names another one is left out.
    """
    found: dict[str, list[NamedFile]] = {sort: [] for sort in FilesOfCell.model_fields}
    for path in sorted(_files(service), key=_changed_s, reverse=True):
        inside = str(path.relative_to(service.folder))
        head = _head(path)
        if path.suffix == ".yaml":
            kind = _motion_kind(head)
            whose = _ROBOT.search(head)
            if kind and (whose is None or whose[1].decode() == robot):
                words = f"{inside} ({kind.replace('_', ' ')})"
                found["motions"].append(NamedFile(path=inside, words=words, kind=kind))
            continue
        for mark, sort in _JSON:
            if mark in head and (
                sort not in _OF_A_ROBOT or _robot_named_in(path, _changed_s(path)) == robot
            ):
                found[sort].append(NamedFile(path=inside, words=inside))
                break
    return FilesOfCell(**{sort: tuple(files) for sort, files in found.items()})


def motion_kind(path: Path) -> str:
    """Return the kind of a motion file, empty where it is none."""
    return _motion_kind(_head(path))


def _motion_kind(head: bytes) -> str:
    found = _MOTION.search(head)
    return "" if found is None else found[1].decode()


def _files(service: CellService) -> Iterator[Path]:
    """Yield what is worth a look: files beside the runs, and JSON that commands put into runs."""
    for path in service.folder.iterdir():
        if path.name.startswith(".") or path == service.runs:
            continue
        for file in (path,) if path.is_file() else path.rglob("*"):
            if file.suffix in (".yaml", ".json") and file.is_file():
                yield file
    if service.runs.is_dir():
        for file in service.runs.glob("*/*.json"):
            if file.name not in _NOT_CHOSEN and file.is_file() and not file.is_symlink():
                yield file


def _changed_s(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # it has just gone
        return 0.0


@functools.lru_cache(maxsize=256)
def _robot_named_in(path: Path, _changed_s: float) -> str:
    """Return the name of the robot in a model or a payload, empty where the file cannot be read."""
    try:
        return str(json.loads(path.read_bytes())["robot"]["name"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except OSError:  # it has just gone, or is not ours to read
        return b""
