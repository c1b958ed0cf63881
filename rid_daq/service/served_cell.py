"""`ServedCell`: a cell of the service: its files as they are now, and what is known of it."""

from __future__ import annotations

import contextlib
import time
from typing import Final

from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from rid_daq.session.cells import is_served

LOOK_S: Final = 1.0


class ServedCell:
    """A cell file, looked at again where a file of it, or one beside it, has changed.

    Args:
        reference: A bundled name or a path.
        pace: How many times the clock's pace the cell keeps where it is simulated.

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
        self._signature: tuple[tuple[str, int, int], ...] | None = None  # unknown as it was read
        self._looked_s = time.monotonic()

    @property
    def loaded(self) -> LoadedCell:
        """The cell as its files say now; as they said last where they are wrong now (`problem`)."""
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_S:
            return self._loaded
        return self.look_again()

    def look_again(self) -> LoadedCell:
        """Return the cell as its files say at this moment; as `loaded`."""
        self._looked_s = time.monotonic()
        try:
            signature = self._look()
            if signature != self._signature or self.problem:
                self._loaded = self._load()
                self._signature, self.problem = signature, ""
        except (ConfigError, OSError) as error:
            self.problem = str(error)
        return self._loaded

    def pace_here(self) -> float | None:
        """Return the pace of a job that begins now; None where other devices keep their own."""
        served = self.pace is not None and is_served(self._loaded.config)
        return None if served else self.pace

    def _load(self) -> LoadedCell:
        loaded = load_cell(self.reference)
        if loaded.config.name != self.name:
            raise ConfigError(
                f"{self.reference}: the cell is called {loaded.config.name!r} now, it was"
                f" {self.name!r}: start the service again",
                code="RID-SERVICE-CELLS",
            )
        return loaded

    def _look(self) -> tuple[tuple[str, int, int], ...]:
        """Return what tells of a change of the files, and of what lies beside the cell's."""
        path = self._loaded.path
        found = []
        with contextlib.suppress(OSError):  # what is gone is told by the load
            beside = () if path is None else path.resolve().parent.iterdir()
            for file in sorted({*self._loaded.paths, *beside}):
                if file.is_file():
                    status = file.stat()
                    found.append((str(file), status.st_mtime_ns, status.st_size))
        return tuple(found)
