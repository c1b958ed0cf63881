"""`JobStore`: every job that was ever accepted, and what became of it."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from typing import Any

from rid_daq.service.records import Job, JobState


class JobStore:
    """The table of jobs.

    Parameters
    ----------
    connection : sqlite3.Connection
        Of the service's file.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, job: Job) -> None:
        """Journal a new job; it is on the disk when this returns."""
        self._connection.execute(
            "INSERT INTO jobs VALUES (?, ?, ?, ?, ?)",
            (job.id, job.cell, job.state.value, job.created_s, job.model_dump_json()),
        )

    def change(self, job: Job, **fields: Any) -> Job:
        """Write new fields of a job, and return it with them."""
        changed = job.model_copy(update=fields)
        self._connection.execute(
            "UPDATE jobs SET state = ?, job = ? WHERE id = ?",
            (changed.state.value, changed.model_dump_json(), job.id),
        )
        return changed

    def get(self, job_id: str) -> Job | None:
        """Return a job, None where there is none of that id."""
        row = self._connection.execute("SELECT job FROM jobs WHERE id = ?", (job_id,)).fetchone()
        return None if row is None else Job.model_validate_json(row[0])

    def newest(
        self, cell: str | None = None, state: JobState | None = None, limit: int = 100
    ) -> Sequence[Job]:
        """Return the newest jobs first, of one cell and in one state where told."""
        rows = self._connection.execute(
            "SELECT job FROM jobs WHERE (?1 IS NULL OR cell = ?1) AND (?2 IS NULL OR state = ?2)"
            " ORDER BY created_s DESC LIMIT ?3",
            (cell, None if state is None else state.value, limit),
        )
        return [Job.model_validate_json(row[0]) for row in rows]

    def unfinished(self) -> Sequence[Job]:
        """Return the jobs that are not over, oldest first."""
        rows = self._connection.execute(
            "SELECT job FROM jobs WHERE state IN (?, ?) ORDER BY created_s",
            (JobState.ACCEPTED.value, JobState.RUNNING.value),
        )
        return [Job.model_validate_json(row[0]) for row in rows]

    def counts(self) -> dict[str, int]:
        """Return how many jobs are in which state."""
        rows = self._connection.execute("SELECT state, COUNT(*) FROM jobs GROUP BY state")
        return {str(state): int(count) for state, count in rows}
