"""`ServedCell`: a cell of the service with the present content of its files."""

from __future__ import annotations

import contextlib
import time
from typing import Final

from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from rid_daq.session.cells import is_served

LOOK_S: Final = 1.0


class ServedCell:
    """Cell that is reloaded if one of its files, or a file in the cell file's folder, has changed.

    Args:
        reference: Bundled name or path of the cell file.
        pace: Speed of the cell if it is simulated, as a multiple of real time.

    Raises:
        ConfigError: The cell cannot be loaded.
    """

    def __init__(self, reference: str, pace: float) -> None:
        loaded = load_cell(reference)
        self.reference = reference if loaded.path is None else str(loaded.path.resolve())
        self.name = loaded.config.name
        self.pace = pace if loaded.config.simulated else None
        self.problem = ""
        self._loaded = loaded
        # None causes a reload at the first check of the files
        self._signature: tuple[tuple[str, int, int], ...] | None = None
        self._looked_s = time.monotonic()

    @property
    def loaded(self) -> LoadedCell:
        """Cell as its files define it; if the files have errors (`problem`), the last valid cell.

        The files are checked again after `LOOK_S`.
        """
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_S:
            return self._loaded
        return self.reload_if_changed()

    def reload_if_changed(self) -> LoadedCell:
        """Check the files now, and return the same cell as `loaded`."""
        self._looked_s = time.monotonic()
        try:
            signature = self._file_signature()
            if signature != self._signature or self.problem:
                self._loaded = self._load()
                self._signature, self.problem = signature, ""
        except (ConfigError, OSError) as error:
            self.problem = str(error)
        return self._loaded

    def own_pace(self) -> float | None:
        """Return the pace of a job that starts now; None if other processes simulate the cell."""
        served = self.pace is not None and is_served(self._loaded.config)
        return None if served else self.pace

    def _load(self) -> LoadedCell:
        loaded = load_cell(self.reference)
        if loaded.config.name != self.name:
            raise ConfigError(
                f"{self.reference}: the cell's name has changed from {self.name!r} to"
                f" {loaded.config.name!r}: restart the service",
                code="RID-SERVICE-CELLS",
            )
        return loaded

    def _file_signature(self) -> tuple[tuple[str, int, int], ...]:
        """Return names, times and sizes of the cell's files and their folder, to detect changes."""
        path = self._loaded.path
        found = []
        with contextlib.suppress(OSError):  # a missing file is reported when the cell is loaded
            beside = () if path is None else path.resolve().parent.iterdir()
            for file in sorted({*self._loaded.paths, *beside}):
                if file.is_file():
                    status = file.stat()
                    found.append((str(file), status.st_mtime_ns, status.st_size))
        return tuple(found)
