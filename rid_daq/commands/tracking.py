"""`rid-daq tracking`: how far the robot was from where it should have been, before and after."""

from __future__ import annotations

from typing import Annotated

import typer

from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import Service, here_or_there
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.options import DEFAULT_RUNS, RunNames, RunsFolder, Unfinished


def tracking(
    run: RunNames,
    against: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN", help="The same motion without compensation; repeat for more."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    service: Service = None,
    as_json: AsJson = False,
) -> None:
    """Compare positions reached with positions wanted, joint by joint and along the tool's path.

    Several motions, each with the run to compare it against, come into one table and one report, in
    the first run's folder. Rows of a motion's main part count. Kinematics are those of the robot
    file.
    """
    from rid_daq.jobs.tracking_job import TrackingRequest
    from rid_daq.performers.compensation.tracking import perform

    request = TrackingRequest(run, against or (), runs, unfinished)
    here_or_there(service, JobKind.TRACKING, request, Console(as_json), perform)
