"""`request_of`: the request of a job, from what a client asked for and what the service sets."""

from __future__ import annotations

from pathlib import Path

from rid_daq.operations.request import Request
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import require_bounded, require_ending


def request_of(
    kind: JobKind,
    told: dict[str, object],
    cell: str,
    runs: Path,
    *,
    cleared: bool,
    owner: str = "",
) -> Request:
    """Return the request of a job.

    Args:
        told: What the client says of it.
        cell: The cell, a bundled name or a file.
        runs: The folder of the run folders.
        cleared: Whether a person has just said that the cell is clear.
        owner: Who has begun the job.

    Raises:
        ConfigError: It is not a request of this kind, or a number in it is outside of its range.
    """
    require_bounded(kind, told)
    owned = {"cell": cell, "runs": str(runs), "cleared": cleared, "tester": owner}
    declared = kind.operation
    declared.refuse_owned(told)
    own = {name: value for name, value in owned.items() if name in declared.owned}
    checked = declared.request.of_json({**told, **own}, shown=kind.value)
    require_ending(kind, told)
    return checked
