"""`EditedFile`: a cell, robot or motion file that clients can change, and the version on disk."""

from __future__ import annotations

import contextlib
import difflib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from acquisition.motion.motion_file import MotionFile
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError, LockedError, system_errors
from config.formats.approved_files import sha256_of
from config.formats.bounded_file import read_file
from config.formats.whole_file import write_new, write_whole
from config.formats.yaml_tree import MAX_BYTES
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from rid_daq.service.refusals import FileChangedError
from rid_daq.service.request_check import require_inside
from rid_daq.service.served_cell import ServedCell

if TYPE_CHECKING:
    from rid_daq.service.service import CellService

MOST_LINES: Final = 400

_MODELS: Final[dict[str, Any]] = {
    "cell.yaml": CellConfig,
    "robot.yaml": RobotDescription,
    "plant.yaml": PlantConfig,
    "amplifier.yaml": AmplifierProfile,
    "drives.yaml": DriveProfile,
}
"""Models of a cell's files by the names under which a run folder stores them."""


@dataclass(frozen=True)
class EditedFile:
    """A YAML file of the service's folder.

    Attributes:
        path: Resolved path.
        shown: Path inside the folder, as clients write it.
        model: Model of its content. A file that belongs to no cell is a motion file.
        cells: Cells that use the file.
    """

    path: Path
    shown: str
    model: Any
    cells: tuple[ServedCell, ...]

    @classmethod
    def find(cls, service: CellService, shown: str) -> EditedFile:
        """Return the file with a path, which need not exist yet if it is a motion file.

        Raises:
            ConfigError: The path is outside the service's folder or hidden, or the file cannot be
                edited (`RID-FILE-TYPE`; in the runs folder `RID-OUTPUT-RUN`).
        """
        path = require_inside(shown, service.folder)
        model: Any = MotionFile
        for cell in service.cells.values():
            for name, of_cell in cell.loaded.disk_names.items():
                if of_cell.resolve() == path:
                    model = ServoProfile if name.startswith("servo") else _MODELS.get(name)
        is_of_run = path.is_relative_to(service.runs.resolve())
        if model is None or path.suffix != ".yaml" or is_of_run:
            raise ConfigError(
                f"{shown}: cannot be edited here: only the YAML files of a cell and motion files"
                " outside the runs folder can",
                code="RID-OUTPUT-RUN" if is_of_run else "RID-FILE-TYPE",
            )
        return cls.of_path(service, path, shown, model)

    @classmethod
    def of_path(cls, service: CellService, path: Path, shown: str, model: Any) -> EditedFile:
        """Return the file at a resolved path, which no client has chosen.

        Args:
            service: The service, whose cells may use the file.
            path: Path of the file.
            shown: Name of the file in messages.
            model: Model of its content.
        """
        cells = (
            cell
            for cell in service.cells.values()
            if any(of_cell.resolve() == path for of_cell in cell.loaded.disk_names.values())
        )
        return cls(path, shown, model, tuple(cells))

    @property
    def is_motion(self) -> bool:
        """True if this is a motion file."""
        return self.model is MotionFile

    def read(self) -> bytes | None:
        """Return the content on disk; None if there is no file.

        Raises:
            ConfigError: The file cannot be read.
        """
        with system_errors(ConfigError, f"{self.shown}: cannot read", code="RID-FILE-READ"):
            return read_file(self.path, MAX_BYTES) if self.path.is_file() else None

    def version(self) -> str:
        """Return the SHA-256 of the content on disk; empty if there is no file."""
        content = self.read()
        return "" if content is None else sha256_of(content)

    def differences(self, content: bytes) -> tuple[str, ...]:
        """Return the lines that differ between the file on disk and another content.

        Lines only on disk begin with "- ", lines only in the content with "+ ", and equal lines
        with two spaces; "…" replaces further equal lines. There are at most `MOST_LINES` lines.
        """
        on_disk, other = (
            (each or b"").decode(errors="replace").splitlines() for each in (self.read(), content)
        )
        lines = difflib.unified_diff(on_disk, other, n=1, lineterm="")
        shown = itertools.islice(lines, 2, 2 + MOST_LINES)  # without the names of the files
        return tuple("…" if line.startswith("@@") else f"{line[0]} {line[1:]}" for line in shown)

    def save(self, content: bytes, version: str) -> None:
        """Replace the content, or make the file if the version is empty.

        Raises:
            FileChangedError: The file has another version: another client has changed, made or
                removed it (`RID-FILE-CHANGED`). The file is unchanged.
            ConfigError, RecordingError: The file exists already, or cannot be written.
        """
        if self.version() != version:
            raise FileChangedError(
                f"{self.shown}: has changed since it was opened: nothing was saved. Compare both"
                " versions, then save yours or use the other one",
                code="RID-FILE-CHANGED",
            )
        if version:
            write_whole(self.path, content)
            return
        with system_errors(ConfigError, f"{self.shown}: cannot be saved", code="RID-FILE-WRITE"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
        write_new(self.path, content)

    @contextlib.contextmanager
    def unused(self, service: CellService, lease: str | None) -> Iterator[None]:
        """Hold the file inside the `with` block; no job of its cells starts, no other client saves.

        Args:
            service: The service.
            lease: Key of the caller's lease.

        Raises:
            LockedError: A job uses a cell of the file, or another client holds the cell.
            FileChangedError: Another client saves the file (`RID-FILE-CHANGED`).
        """
        with service.file_locks.hold(self):
            self._require_unused(service, lease)
            yield

    def _require_unused(self, service: CellService, lease: str | None) -> None:
        for cell in self.cells:
            if service.job_runner.is_busy(cell.name):
                raise LockedError(
                    f"cell {cell.name}: a job is running: wait for its end, or stop it, before you"
                    f" change {self.shown}",
                    code="RID-JOB-RUNNING",
                )
            if service.leases.lease_of(cell.name) is not None:
                service.leases.require(cell.name, lease)


class FileLocks:
    """Files that are being saved now: one client saves a file, and no job of its cells starts.

    Only the event loop calls the methods. A check and the action after it are therefore one step if
    no `await` is between them.
    """

    def __init__(self) -> None:
        self._held: dict[Path, EditedFile] = {}

    @contextlib.contextmanager
    def hold(self, file: EditedFile) -> Iterator[None]:
        """Hold a file inside the `with` block.

        Raises:
            FileChangedError: Another client saves the file (`RID-FILE-CHANGED`).
        """
        if file.path in self._held:
            raise FileChangedError(
                f"{file.shown}: another client saves this file now: nothing was saved. Try again",
                code="RID-FILE-CHANGED",
            )
        self._held[file.path] = file
        try:
            yield
        finally:
            del self._held[file.path]

    def require_none_of(self, cell: ServedCell) -> None:
        """Raise an error if a file of a cell is being saved.

        Raises:
            LockedError: A file of the cell is being saved (`RID-FILE-SAVING`).
        """
        for file in self._held.values():
            if cell in file.cells:
                raise LockedError(
                    f"cell {cell.name}: {file.shown} is being saved now: try again",
                    code="RID-FILE-SAVING",
                )
