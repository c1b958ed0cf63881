"""`PackageFolders`: search for the files that a URDF names by ROS packages or relative paths."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from urllib.parse import unquote

from config.errors import ConfigError
from config.meshes.mesh_file import CODE

DEEPEST: Final = 3
RENAMED: Final = 4
"""Number of folders above a URDF that can be a package whose folder was renamed."""
_PACKAGE: Final = re.compile(r"(?:package|model)://+([^/]+)/+(.*)", re.DOTALL)
_FIND: Final = re.compile(r"(?:file://)?\$\(find(?:-pkg-share)?\s+([^\s)]+)\s*\)/*(.*)", re.DOTALL)
_NAME: Final = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


@dataclass(frozen=True)
class PackageFolders:
    """Places in which the files of a URDF are searched.

    Attributes:
        urdf: The URDF; relative paths begin at its folder. Packages are also searched in all
            folders above it. If a package is not found anywhere, each of the `RENAMED` folders
            directly above the URDF is tried as the package's folder, which may have been renamed.
        folders: Folders that the user names. Each contains packages, in itself or at most three
            folders below, or is a package.
        installed: Folders of installed packages; they are searched last.
    """

    urdf: Path
    folders: tuple[Path, ...] = ()
    installed: tuple[Path, ...] = ()
    _found: dict[tuple[Path, str], tuple[Path, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def locate(self, address: str) -> Path:
        """Return the file of an address.

        Args:
            address: `package://NAME/PATH`, `model://NAME/PATH`, `$(find NAME)/PATH`, `file:///PATH`
                or a path.

        Raises:
            ConfigError: The file does not exist; the message names the paths that were tried, or
                the package that is in no known folder.
        """
        named = _PACKAGE.fullmatch(address) or _FIND.fullmatch(address)
        if named is None:
            places, inside = [self.urdf.parent], _spellings(address.removeprefix("file://"))
        else:
            places, inside = list(self._candidate_folders(named[1])), _spellings(named[2])
        renamed = list(self.urdf.absolute().parents)[:RENAMED] if named and not places else []
        tried = list(dict.fromkeys(place / part for place in places or renamed for part in inside))
        for path in tried:
            if os.path.isfile(path):
                return path
        if renamed and named:
            raise ConfigError(
                f"the ROS package {named[1]!r} is in no known folder: give the folder that contains"
                " it with --packages",
                code=CODE,
            )
        raise ConfigError(
            f"there is no file {' or '.join(map(str, tried))}: correct the path in the URDF"
            + (", or give another folder of the package with --packages" if named else ""),
            code=CODE,
        )

    def _candidate_folders(self, package: str) -> Iterator[Path]:
        """Yield the folders in which a package may be, the most likely first."""
        for folder in self.folders:
            yield from self._search(folder.absolute(), package)
        for above in self.urdf.absolute().parents:
            if _is_package(above, package):
                yield above
            if os.path.isdir(above / package):
                yield above / package
        for folder in self.installed:
            if os.path.isdir(folder / package):
                yield folder / package

    def _search(self, folder: Path, package: str) -> tuple[Path, ...]:
        """Return the folders of a package below a folder; they are searched once per package."""
        found = self._found.get((folder, package))
        if found is None:
            found = tuple(_packages_below(folder, package, DEEPEST))
            self._found[folder, package] = found
        return found


def _spellings(path: str) -> list[str]:
    """Return a path as written and, if it differs, with its percent escapes decoded."""
    return list(dict.fromkeys((path, unquote(path))))


def _packages_below(folder: Path, package: str, depth: int) -> Iterator[Path]:
    """Yield the folders of a package in a folder and at most `depth` folders below it."""
    if _is_package(folder, package):
        yield folder
    if depth == 0:
        return
    try:
        below = sorted(each for each in folder.iterdir() if each.is_dir())
    except OSError:
        return
    for each in below:
        if not each.name.startswith(".") and not each.is_symlink():
            yield from _packages_below(each, package, depth - 1)


def _is_package(folder: Path, package: str) -> bool:
    """Return whether a folder has the package's name, itself or in its package.xml."""
    if folder.name == package:
        return True
    try:
        text = (folder / "package.xml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    found = _NAME.search(text)
    return found is not None and found[1] == package
