"""`open_database`: the service's SQLite file, made where there is none."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from typing import Final

from config.errors import RecordingError

VERSION: Final = 1

_SCHEMA = """
CREATE TABLE jobs (
    id TEXT PRIMARY KEY, cell TEXT NOT NULL, state TEXT NOT NULL, created_s REAL NOT NULL,
    job TEXT NOT NULL
);
CREATE INDEX jobs_of_cells ON jobs (cell, created_s);
CREATE INDEX jobs_by_state ON jobs (state);
CREATE TABLE leases (cell TEXT PRIMARY KEY, key_hash TEXT NOT NULL, lease TEXT NOT NULL);
CREATE TABLE tokens (id TEXT PRIMARY KEY, hash TEXT NOT NULL UNIQUE, token TEXT NOT NULL);
CREATE TABLE cells (cell TEXT PRIMARY KEY, preflight TEXT, files_hash TEXT, fault TEXT NOT NULL);
CREATE TABLE audit (
    number INTEGER PRIMARY KEY AUTOINCREMENT, at_s REAL NOT NULL, entry TEXT NOT NULL
);
"""

_LATER = "CREATE TABLE IF NOT EXISTS lease_tokens (cell TEXT PRIMARY KEY, lease TEXT, token TEXT)"
"""What came after the first services; a program of before leaves it alone."""


def open_database(path: Path) -> sqlite3.Connection:
    """Return a connection to the service's file, which only its owner may read.

    Raises
    ------
    RecordingError
        It cannot be opened, is damaged, or was written by a newer program.
    """
    try:
        os.close(os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600))
        connection = sqlite3.connect(path, isolation_level=None, timeout=5.0)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        if version == 0:
            connection.executescript(f"BEGIN;{_SCHEMA}PRAGMA user_version = {VERSION};COMMIT;")
        elif version != VERSION:
            raise RecordingError(
                f"{path}: was written by another version of rid-daq (format {version}, this one"
                f" knows {VERSION}): use that one, or move the file away to begin anew"
            )
        connection.execute(_LATER)
    except (OSError, sqlite3.Error) as error:
        raise RecordingError(
            f"{path}: cannot be opened as the service's file: {error}. Move it away to begin anew"
        ) from None
    return connection
