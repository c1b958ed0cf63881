"""`folder_files`: the motions, models and other files of the service's folder, by what they are."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.motion.motion_file import MOTION_KINDS
from rid_daq.service.service import CellService

HEAD_BYTES: Final = 4096
_KINDS: Final = "|".join(sorted(MOTION_KINDS, key=len, reverse=True))
_MOTION = re.compile(rf"^kind:\s*[\"']?({_KINDS})\b".encode(), re.MULTILINE)
_ROBOT = re.compile(rb"^robot:\s*[\"']?([\w.-]+)", re.MULTILINE)
_JSON: Final = (
    (b'"rid-daq estimate"', "models"),
    (b'"rid-daq velocity loops 1"', "loops"),
    (b'"rid-daq feedforward 1"', "feedforwards"),
)
_NOT_CHOSEN: Final = frozenset({"manifest.json", "result.json", "session.json", "payload.json"})


@dataclass(frozen=True)
class NamedFile:
    """A file that requests may name.

    Attributes
    ----------
    path : str
        Inside the service's folder.
    words : str
        What people read in a list.
    kind : str
        Of a motion: its kind.
    """

    path: str
    words: str
    kind: str = ""


@dataclass(frozen=True)
class FolderFiles:
    """The files of each sort, the newest first."""

    motions: tuple[NamedFile, ...]
    models: tuple[NamedFile, ...]
    loops: tuple[NamedFile, ...]
    feedforwards: tuple[NamedFile, ...]


def folder_files(service: CellService, robot: str) -> FolderFiles:
    """Return the files of a service's folder; of runs, what commands have written into them.

    Parameters
    ----------
    service : CellService
        The service.
    robot : str
        The name of the cell's robot; motions and models of another one are left out.
    """
    found: dict[str, list[NamedFile]] = {
        sort: [] for sort in ("motions", "models", "loops", "feedforwards")
    }
    for path in sorted(_files(service), key=_changed_s, reverse=True):
        inside = str(path.relative_to(service.folder))
        head = _head(path)
        motion = _MOTION.search(head)
        if path.suffix == ".yaml":
            whose = _ROBOT.search(head)
            if motion is not None and (whose is None or whose[1].decode() == robot):
                kind = motion[1].decode()
                found["motions"].append(NamedFile(inside, f"{inside} ({_spaced(kind)})", kind))
            continue
        for mark, sort in _JSON:
            if mark in head and (
                sort != "models" or _robot_of_model(path, _changed_s(path)) == robot
            ):
                found[sort].append(NamedFile(inside, inside))
                break
    return FolderFiles(**{sort: tuple(files) for sort, files in found.items()})


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
def _robot_of_model(path: Path, _changed_s: float) -> str:
    """Return the name of a model's robot, empty where the file cannot be read."""
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


def _spaced(kind: str) -> str:
    return kind.replace("_", " ")
