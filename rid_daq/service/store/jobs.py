"""`JobStore`: table of all jobs that were ever accepted, with their outcome."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

from rid_daq.service.records import Job, JobState
from rid_daq.service.store.database import Database

MOST_KEPT: Final = 1000
"""Number of jobs in memory above which the oldest ended job is removed from memory."""


class JobStore:
    """Table of jobs.

    Unfinished jobs, and the newest jobs since the service was started, are kept in memory too.

    Args:
        database: The service's database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        rows = database.read(
            "SELECT job FROM jobs WHERE state IN (?, ?) ORDER BY created_s",
            JobState.ACCEPTED.value,
            JobState.RUNNING.value,
        )
        found = [Job.model_validate_json(row[0]) for row in rows]
        self._kept = {job.id: job for job in found}
        counts = database.read("SELECT state, COUNT(*) FROM jobs GROUP BY state")
        self._counts = Counter({JobState(state): int(count) for state, count in counts})

    def add(self, job: Job) -> None:
        """Add a new job; it is on the disk after `wait_until_saved`."""
        self._remember(job)
        self._database.write(
            "INSERT INTO jobs VALUES (?, ?, ?, ?, ?)",
            job.id,
            job.cell,
            job.state.value,
            job.created_s,
            job.model_dump_json(),
        )

    def change(self, job: Job, **fields: Any) -> Job:
        """Set fields of a job, save it, and return the changed job."""
        changed = job.model_copy(update=fields)
        if job.id in self._kept:
            self._remember(changed)
        self._database.write(
            "UPDATE jobs SET state = ?, job = ? WHERE id = ?",
            changed.state.value,
            changed.model_dump_json(),
            job.id,
        )
        return changed

    async def wait_until_saved(self) -> None:
        """Wait until all changes so far are on the disk.

        Raises:
            StoreBusyError: They are not on the disk within some seconds.
        """
        await self._database.wait_until_saved()

    def in_memory(self, job_id: str) -> Job | None:
        """Return a job that is in memory, None for any other; every unfinished job is in memory."""
        return self._kept.get(job_id)

    def get(self, job_id: str) -> Job | None:
        """Return a job, None if no job has this id.

        Call it in a thread: old jobs are read from the disk.
        """
        kept = self._kept.get(job_id)
        if kept is not None:
            return kept
        rows = self._database.read("SELECT job FROM jobs WHERE id = ?", job_id)
        return Job.model_validate_json(rows[0][0]) if rows else None

    def newest(
        self, cell: str | None = None, state: JobState | None = None, limit: int = 100
    ) -> Sequence[Job]:
        """Return the jobs of a cell in a state (default: any), newest first.

        Call this function in a thread, because it blocks.
        """
        kept = dict(self._kept)  # the copies in memory are newer than the file
        rows = self._database.read(
            "SELECT job FROM jobs WHERE (?1 IS NULL OR cell = ?1) AND (?2 IS NULL OR state = ?2)"
            " ORDER BY created_s DESC LIMIT ?3",
            cell,
            None if state is None else state.value,
            limit + len(kept),
        )
        found = {job.id: job for job in (Job.model_validate_json(row[0]) for row in rows)} | kept
        wanted = [
            job for job in found.values() if cell in (None, job.cell) and state in (None, job.state)
        ]
        return sorted(wanted, key=lambda job: job.created_s, reverse=True)[:limit]

    def unfinished(self) -> Sequence[Job]:
        """Return the unfinished jobs, oldest first."""
        return [job for job in self._kept.values() if not job.state.is_over]

    def counts(self) -> dict[str, int]:
        """Return the number of jobs by state."""
        return {state.value: count for state, count in self._counts.items()}

    def _remember(self, job: Job) -> None:
        before = self._kept.get(job.id)
        if before is not None:
            self._counts[before.state] -= 1
        self._counts[job.state] += 1
        self._kept[job.id] = job
        if len(self._kept) > MOST_KEPT:
            over = next((each.id for each in self._kept.values() if each.state.is_over), None)
            if over is not None:
                del self._kept[over]
