"""`folder_files`: lists the motions, models and other files of a service's folder by their kind."""

from __future__ import annotations

import contextlib
import functools
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from acquisition.motion.motion_file import MOTION_KINDS
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import MANIFEST
from config.errors import ConfigError, RidDaqError
from config.formats.bounded_file import open_file, read_file
from config.formats.json_file import parse_json
from rid_daq.service.records import FilesOfCell, NamedFile
from rid_daq.service.request_check import is_file_name, is_hidden

if TYPE_CHECKING:
    from rid_daq.service.service import CellService

HEAD_BYTES: Final = 4096
MOST_BYTES: Final = 200_000_000
CHANGING_S: Final = 2.0
"""A folder that was changed within this time is read at each call: a further change may have the
same time stamp [s]."""
KINDS: Final = frozenset({".yaml", ".json"})
_KINDS: Final = "|".join(sorted(MOTION_KINDS, key=len, reverse=True))
_MOTION = re.compile(rf"^(?:{{.*?\b)?kind:\s*[\"']?({_KINDS})\b".encode(), re.MULTILINE)
_ROBOT = re.compile(rb"^(?:{.*?\b)?robot:\s*[\"']?([\w.-]+)", re.MULTILINE)
_JSON: Final = (
    (b'"rid-daq estimate"', "models"),
    (b'"rid-daq velocity loops 3"', "loops"),
    (b'"rid-daq feedforward 1"', "feedforwards"),
    (b'"rid-daq payload"', "payloads"),
)
_OF_A_ROBOT: Final = frozenset({"models", "payloads"})
_RESULT_STEMS: Final = frozenset({"model", "loops", "payload"})
"""Usual names of a run's results; another name is shown with the run."""
_NOT_CHOSEN: Final = frozenset({"manifest.json", "result.json", "session.json"})


def folder_files(service: CellService, robot: str) -> FilesOfCell:
    """Return the files of a service's folder, newest first; from run folders, only JSON results.

    Args:
        robot: Name of the cell's robot; motions, models and payloads of other robots are left out.
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
                of_robot = robot if sort in _OF_A_ROBOT else ""
                found[sort].append(_named_result(service, path, inside, of_robot))
                break
    return FilesOfCell(**{sort: tuple(files) for sort, files in found.items()})


def _named_result(service: CellService, path: Path, inside: str, robot: str) -> NamedFile:
    """Return the entry of a result; that of a run is named by the run's label and robot."""
    run = path.parent
    if run.parent != service.runs:
        return NamedFile(path=inside, words=inside)
    label, created_utc = _head_of_run(run, _changed_s(run / MANIFEST))
    if not label:
        return NamedFile(path=inside, words=inside)
    more = [*([robot] if robot else []), *([] if path.stem in _RESULT_STEMS else [path.name])]
    words = f"{label} ({', '.join(more)})" if more else label
    return NamedFile(path=inside, words=words, made_utc=created_utc)


@functools.lru_cache(maxsize=1 << 16)
def _head_of_run(run: Path, _changed_s: float) -> tuple[str, str]:
    """Return label and start of a run; empty if its manifest cannot be read."""
    try:
        manifest = RunFolder(run, run.name).manifest()
    except RidDaqError:
        return "", ""
    return manifest.label or manifest.kind, manifest.created_utc


def motion_kind(path: Path) -> str:
    """Return the kind of a motion file, empty for any other file."""
    return _motion_kind(_head(path))


def _motion_kind(head: bytes) -> str:
    found = _MOTION.search(head)
    return "" if found is None else found[1].decode()


class Uploads:
    """File names of the uploads in progress: no second upload can use the same name."""

    def __init__(self) -> None:
        self._names: set[Path] = set()

    @contextlib.contextmanager
    def reserve(self, file: Path, shown: str) -> Iterator[None]:
        """Reserve a file name inside the `with` block.

        Raises:
            ConfigError: A file with this name exists, or is being uploaded (`RID-FILE-EXISTS`).
        """
        if file in self._names or os.path.lexists(file):
            raise ConfigError(
                f"{shown}: exists already: choose another name", code="RID-FILE-EXISTS"
            )
        self._names.add(file)
        try:
            yield
        finally:
            self._names.discard(file)


def visible_files(folder: Path, without: Path | None = None) -> Iterator[Path]:
    """Yield the YAML and JSON files that clients can name; no pipes, no links out of the folder.

    Args:
        folder: Folder to search, with the folders below it.
        without: Folder that is left out.
    """
    root = folder.resolve()
    for place, folders, names in os.walk(folder):
        here = Path(place)
        folders[:] = [
            each for each in folders if not is_hidden(Path(each)) and here / each != without
        ]
        for path in (here / name for name in names):
            if path.suffix in KINDS and _can_be_named(path.relative_to(folder)):
                with contextlib.suppress(
                    OSError, RuntimeError
                ):  # the file has just been removed, or is a loop of links
                    if path.is_file() and path.resolve().is_relative_to(root):
                        yield path


def _can_be_named(inside: Path) -> bool:
    return not is_hidden(inside) and is_file_name(str(inside))


def _files(service: CellService) -> Iterator[Path]:
    """Yield files outside the runs folder, and JSON files that jobs wrote into run folders."""
    yield from visible_files(service.folder, without=service.runs)
    if not service.runs.is_dir():
        return
    with os.scandir(service.runs) as runs:
        for run in runs:
            try:
                if not run.is_dir(follow_symlinks=False):
                    continue
                changed_ns = run.stat().st_mtime_ns
            except OSError:  # the folder has just been removed
                continue
            is_settled = time.time_ns() - changed_ns > CHANGING_S * 1e9
            names = _results_in if is_settled else _results_in.__wrapped__
            for name in names(run.path, changed_ns):
                path = service.runs / run.name / name
                if _can_be_named(path.relative_to(service.folder)):
                    yield path


@functools.lru_cache(maxsize=1 << 16)
def _results_in(run: str, _changed_ns: int) -> tuple[str, ...]:
    """Return the names of the JSON files that jobs wrote into a run folder."""
    with contextlib.suppress(OSError), os.scandir(run) as files:  # it has just been removed
        return tuple(
            each.name
            for each in files
            if each.name.endswith(".json")
            and each.name not in _NOT_CHOSEN
            and each.is_file(follow_symlinks=False)
        )
    return ()


def _changed_s(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # the file has just been removed
        return 0.0


@functools.lru_cache(maxsize=256)
def _robot_named_in(path: Path, _changed_s: float) -> str:
    """Return the robot's name in a model or payload file, empty if the file cannot be read."""
    try:
        return str(parse_json(read_file(path, MOST_BYTES))["robot"]["name"])
    except (OSError, ConfigError, KeyError, TypeError):
        return ""


def _head(path: Path) -> bytes:
    try:
        with open_file(path, MOST_BYTES) as file:
            return file.read(HEAD_BYTES)
    except OSError:  # the file has just been removed, or cannot be read
        return b""
