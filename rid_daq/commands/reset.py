"""`rid-daq reset`: a person resets the faults of a cell's drives."""

from __future__ import annotations

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import CellName


def reset(
    cell: CellName,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Reset the faults of a cell's drives, once you have found and removed their causes.

    The program never does this by itself. No power is switched on and nothing moves; motion needs
    the whole preflight again. Exit code 3 where a drive stays in fault.
    """
    from rid_daq.performers.reset import ResetRequest, perform

    here_or_there(service, JobKind.RESET, ResetRequest(cell), Console(as_json), perform)
