"""`rid-daq tracking`: how far the robot was from where it should have been."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from acquisition.motion_samples import Phase
from acquisition.run_list import find_run
from compensation.tracking_error import TrackingError, tracking_error
from config.errors import DataQualityError
from dynamics.kinematics import Chain
from rid_daq.console import AsJson, Console
from rid_daq.run_data import RunData, read_run
from rid_daq.session import DEFAULT_RUNS, RunsFolder


def tracking(
    run: Annotated[
        str, typer.Argument(metavar="RUN", help="A run folder, its id or label, or `latest`.")
    ],
    against: Annotated[
        str | None, typer.Option(metavar="RUN", help="The same motion without compensation.")
    ] = None,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Compare positions reached with positions wanted, joint by joint and along the tool's path.

    Rows of the motion's main part count. Kinematics are those of the robot file.
    """
    console = Console(as_json)
    data = read_run(find_run(runs, run))
    error = _error(data)
    document: dict[str, Any] = {"run": data.folder.run_id, **_entry(data, error)}
    before = None
    if against is not None:
        other = read_run(find_run(runs, against))
        before = _error(other)
        document["against"] = {"run": other.folder.run_id, **_entry(other, before)}
        document["mean_ratio"] = before.mean_m / error.mean_m
        document["max_ratio"] = before.max_m / error.max_m
    console.document(document)
    console.table(
        ("", "mean [mm]", "max [mm]", *(f"{name} peak" for name in data.robot.joint_names)),
        [_row("run", error), *([] if before is None else [_row("against", before)])],
    )
    if before is not None:
        console.say(
            f"The path is {before.mean_m / error.mean_m:.1f} times closer in the mean,"
            f" {before.max_m / error.max_m:.1f} times at its worst."
        )


def _error(data: RunData) -> TrackingError:
    recording = data.recording
    main = (recording.phase == Phase.MAIN) & recording.valid
    if recording.target_position is None or not main.any():
        raise DataQualityError(
            f"run {data.folder.run_id} says nothing of where the robot should have been: tracking"
            " needs a run of this program's own"
        )
    chain = Chain.from_description(data.robot)
    return tracking_error(chain, recording.target_position[main], recording.position[main])


def _entry(data: RunData, error: TrackingError) -> dict[str, Any]:
    peaks = zip(data.robot.joint_names, error.joint_peak.tolist(), strict=True)
    return {"mean_m": error.mean_m, "max_m": error.max_m, "joint_peak": dict(peaks)}


def _row(name: str, error: TrackingError) -> tuple[str, ...]:
    peaks = (f"{1e3 * peak:.2f}e-3" for peak in error.joint_peak)
    return (name, f"{1e3 * error.mean_m:.3f}", f"{1e3 * error.max_m:.3f}", *peaks)
