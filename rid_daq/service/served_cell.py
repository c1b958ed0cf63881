"""`ServedCell`: a cell of the service: its files as they are now, and what is known of it."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Final

from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from rid_daq.session.cells import is_served

LOOK_S: Final = 1.0


class ServedCell:
    """A cell file, looked at again where it, or what lies beside it, has changed.

    Parameters
    ----------
    reference : str
        A bundled name or a path.
    pace : float
        How many times the clock's pace the cell keeps where it is simulated.

    Raises
    ------
    ConfigError
        The cell cannot be loaded.
    """

    def __init__(self, reference: str, pace: float) -> None:
        loaded = load_cell(reference)
        self.reference = reference if loaded.path is None else str(loaded.path.resolve())
        self.name = loaded.config.name
        self.pace = pace if loaded.config.simulated else None
        self.problem = ""
        self._loaded = loaded
        self._signature = self._look()
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
        signature = self._look()
        if signature != self._signature:
            self._signature = signature
            try:
                loaded = load_cell(self.reference)
                if loaded.config.name != self.name:
                    raise ConfigError(
                        f"{self.reference}: the cell is called {loaded.config.name!r} now, it was"
                        f" {self.name!r}: start the service again"
                    )
                self._loaded, self.problem = loaded, ""
            except ConfigError as error:
                self.problem = str(error)
        return self._loaded

    def pace_here(self) -> float | None:
        """Return the pace of a job that begins now; None where other devices keep their own."""
        served = self.pace is not None and is_served(self._loaded.config)
        return None if served else self.pace

    def files_hash(self) -> str:
        """Return a hash of all the files of the cell."""
        digest = hashlib.sha256()
        for name, content in sorted(self.loaded.files.items()):
            digest.update(f"{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()

    def _look(self) -> tuple[tuple[str, int, int], ...]:
        path = self._loaded.path
        if path is None:
            return ()
        found = []
        for file in sorted(Path(path).resolve().parent.iterdir()):
            if file.is_file():
                status = file.stat()
                found.append((file.name, status.st_mtime_ns, status.st_size))
        return tuple(found)
