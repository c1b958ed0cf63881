"""`Database`: SQLite file of the service; a thread writes it, so the event loop is not blocked."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sqlite3
import threading
import time
import weakref
from collections import deque
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Final

from config.errors import RecordingError
from config.formats.json_file import OTHER_FORMAT
from rid_daq.service.logs import LOG
from rid_daq.service.refusals import StoreBusyError

VERSION: Final = 2
PATIENCE_S: Final = 3.0
"""Maximum time for which an answer waits until its data are on the disk [s]."""

BUSY: Final = "RID-STORE-BUSY"
LOCK_S: Final = 1.0
RETRY_S: Final = 0.2
IDLE_S: Final = 5.0
LAST_WORDS_S: Final = 5.0
MOST_NOTES: Final = 10_000
MOST_AT_ONCE: Final = 200

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
CREATE TABLE lease_tokens (cell TEXT PRIMARY KEY, lease TEXT, token TEXT);
CREATE TABLE issued (number INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE);
CREATE TABLE lease_ends (cell TEXT PRIMARY KEY, lease TEXT, ends_s REAL, boot TEXT);
"""

_MISTAKES = (sqlite3.IntegrityError, sqlite3.ProgrammingError, sqlite3.DataError)
"""Errors of an invalid statement: it would fail again if it were repeated."""


class Database:
    """Writes statements in their order in a separate thread; reads with short connections.

    A write that fails because the disk is full or another program locks the file is repeated until
    it succeeds or the service ends. The stores therefore answer from memory, and the file follows.

    Args:
        path: Path of the file.
        connection: Connection of the writing thread.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path = path
        self._connection = connection
        # If the service fails before it can call `close`, its file is closed with this object.
        weakref.finalize(self, connection.close).atexit = False
        self._changed = threading.Condition()
        self._queue: deque[tuple[str, tuple[object, ...]]] = deque()
        self._queued = self._written = 0
        self._waiting: list[tuple[int, asyncio.AbstractEventLoop, asyncio.Future[None]]] = []
        self._thread: threading.Thread | None = None
        self._trouble = ""
        self._close_by_s: float | None = None

    def write(self, sql: str, *values: object) -> None:
        """Queue a statement; it is executed after the statements before it."""
        with self._changed:
            self._queue.append((sql, values))
            self._queued += 1
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._write_queued, name="rid database", daemon=True
                )
                self._thread.start()
            self._changed.notify_all()

    def note(self, sql: str, *values: object) -> None:
        """Queue a statement that may be lost if the file cannot be written for a long time."""
        if len(self._queue) < MOST_NOTES:
            self.write(sql, *values)

    def read(self, sql: str, *values: object) -> list[tuple[Any, ...]]:
        """Return rows; statements that were queued before are included if they can be written soon.

        This function blocks: do not call it in the event loop.

        Raises:
            StoreBusyError: The file cannot be read.
        """
        self.flush(LOCK_S)
        try:
            with contextlib.closing(sqlite3.connect(self._path, timeout=PATIENCE_S)) as reader:
                return reader.execute(sql, values).fetchall()
        except sqlite3.Error as error:
            raise StoreBusyError(
                f"the service's database {self._path.name} cannot be read: {error}; try again"
                " later",
                code=BUSY,
            ) from None

    def flush(self, patience_s: float) -> bool:
        """Return True if all statements queued now are written within `patience_s`."""
        with self._changed:
            wanted = self._queued
            return self._changed.wait_for(lambda: self._written >= wanted, patience_s)

    async def wait_until_saved(self, patience_s: float = PATIENCE_S) -> None:
        """Wait, without blocking the event loop, until all statements queued now are on the disk.

        Raises:
            StoreBusyError: They are not on the disk within `patience_s`.
        """
        with self._changed:
            if self._written >= self._queued:
                return
            loop = asyncio.get_running_loop()
            done: asyncio.Future[None] = loop.create_future()
            self._waiting.append((self._queued, loop, done))
        try:
            await asyncio.wait_for(done, patience_s)
        except TimeoutError:
            raise StoreBusyError(
                f"the service's database {self._path.name} was not written within {patience_s:g}"
                f" s ({self._trouble or 'the disk is slow'}): free disk space, or end the program"
                " that locks the file; then try again",
                code=BUSY,
            ) from None

    def close(self) -> None:
        """Write the queued statements within some seconds, and close the file."""
        with self._changed:
            self._close_by_s = time.monotonic() + LAST_WORDS_S
            self._changed.notify_all()
            thread = self._thread
        if thread is not None:
            thread.join(LAST_WORDS_S + 2 * LOCK_S)
        if self._queue:
            LOG.error("%d entries could not be written: %s", len(self._queue), self._trouble)
        if thread is None or not thread.is_alive():
            self._connection.close()

    def _write_queued(self) -> None:
        at_once = MOST_AT_ONCE
        while batch := self._next_batch(at_once):
            try:
                self._commit(batch)
            except _MISTAKES as error:
                if len(batch) > 1:
                    at_once = 1  # write single statements, to find the invalid one
                    continue
                LOG.error("statement not written: %s: %s", batch[0][0], error)
            except sqlite3.Error as error:
                self._report_trouble(str(error))
                with self._changed:
                    if self._close_by_s is not None and time.monotonic() > self._close_by_s:
                        return
                    self._changed.wait(RETRY_S)
                continue
            else:
                at_once = MOST_AT_ONCE
                self._report_trouble("")
            self._count_written(len(batch))

    def _next_batch(self, at_once: int) -> Sequence[tuple[str, tuple[object, ...]]]:
        """Return the next statements to write; an empty list if the thread must end."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._close_by_s is not None, IDLE_S)
            if not self._queue:
                self._thread = None
            return list(islice(self._queue, at_once))

    def _commit(self, batch: Sequence[tuple[str, tuple[object, ...]]]) -> None:
        try:
            self._connection.execute("BEGIN IMMEDIATE")
            for sql, values in batch:
                self._connection.execute(sql, values)
            self._connection.execute("COMMIT")
        except sqlite3.Error:
            with contextlib.suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def _count_written(self, written: int) -> None:
        with self._changed:
            for _ in range(written):
                self._queue.popleft()
            self._written += written
            ready = [each for each in self._waiting if each[0] <= self._written]
            self._waiting = [each for each in self._waiting if each[0] > self._written]
            self._changed.notify_all()
        for _, loop, done in ready:
            with contextlib.suppress(RuntimeError):  # the waiting event loop has ended
                loop.call_soon_threadsafe(_resolve, done)

    def _report_trouble(self, trouble: str) -> None:
        if trouble and not self._trouble:
            LOG.error(
                "the service's database cannot be written; the write is repeated: %s", trouble
            )
        elif self._trouble and not trouble:
            LOG.info("the service's database can be written again")
        self._trouble = trouble


def _resolve(done: asyncio.Future[None]) -> None:
    if not done.done():
        done.set_result(None)


def open_database(path: Path) -> Database:
    """Open the database of a service; create it if it is missing.

    Only the owner of the file can read it.

    Raises:
        RecordingError: The file cannot be opened, is damaged, or has another format.
    """
    try:
        flags = os.O_CREAT | os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
        os.close(os.open(path, flags, 0o600))
        connection = sqlite3.connect(
            path, isolation_level=None, timeout=LOCK_S, check_same_thread=False
        )
        database = Database(path, connection)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        if version == 0:
            connection.executescript(f"BEGIN;{_SCHEMA}PRAGMA user_version = {VERSION};COMMIT;")
        elif version != VERSION:
            raise RecordingError(
                f"{path}: was written by another version of rid-daq (format {version}, this"
                f" version supports {VERSION}): use that version, or move the file away to start"
                " with an empty database",
                code=OTHER_FORMAT,
            )
    except (OSError, sqlite3.Error) as error:
        raise RecordingError(
            f"{path}: cannot be opened as the service's database: {error}. Move it away to start"
            " with an empty database",
            code="RID-STATE-DAMAGED",
        ) from None
    return database
