"""`rid-daq tracking`: how far the robot was from where it should have been, before and after."""

from __future__ import annotations

from typing import Annotated

import typer

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError, DataQualityError
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.tracking import ErrorSize, FollowedMotion, TrackingSection
from rid_daq.runs.followed_motion import followed
from rid_daq.runs.motion_runs import MotionRun, read_motion_run
from rid_daq.runs.run_data import Unfinished, report_lacks, result_of
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console


def tracking(
    run: Annotated[
        list[str],
        typer.Argument(metavar="RUN...", help="Run folders, ids or labels, or `latest`."),
    ],
    against: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN", help="The same motion without compensation; repeat for more."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Compare positions reached with positions wanted, joint by joint and along the tool's path.

    Several motions, each with the run to compare it against, come into one table and one report, in
    the first run's folder. Rows of a motion's main part count. Kinematics are those of the robot
    file.
    """
    console = Console(as_json)
    driven = [read_motion_run(folder, unfinished=unfinished) for folder in find_runs(runs, run)]
    others = [
        read_motion_run(folder, unfinished=unfinished) for folder in find_runs(runs, against or ())
    ]
    notes = report_lacks(console, [one.data for one in (*driven, *others)])
    robot = driven[0].data.robot
    for one in (*driven, *others):
        if one.data.robot != robot:
            raise ConfigError(
                f"run {one.run_id} is of robot {one.data.robot.name!r}, or of another state of its"
                f" file, run {driven[0].run_id} of {robot.name!r}: compare runs of one"
            )
    pairs = [(one, _before(one, others)) for one in driven]
    for other in others:
        if all(other is not before for _, before in pairs):
            raise ConfigError(
                f"--against {other.run_id}: is of none of the motions given; compare runs of the"
                " same motion"
            )
    section = TrackingSection.of([followed(*pair) for pair in pairs], robot)
    result = result_of(driven[0].data, notes).updated(
        title=f"Paths of {robot.name}", tracking=section, verdict=section.verdict
    )
    path = write_result(driven[0].data.folder, result)
    console.document(
        _document(pairs, section, robot.joint_names) | {"notes": notes, "report": str(path)}
    )
    console.table(
        (
            "motion",
            "its own runs",
            "mean [mm]",
            "before",
            "closer",
            "largest [mm]",
            "before",
            "closer",
        ),
        [
            (
                one.data.folder.manifest().label,
                motion.use,
                *_row(motion, "mean_m", motion.mean_ratio),
                *_row(motion, "max_m", motion.max_ratio),
            )
            for (one, _), motion in zip(pairs, section.motions, strict=True)
        ],
    )
    console.verdict(None, section.verdict.headline)
    console.say(f"Report: {path}")


def _before(run: MotionRun, others: list[MotionRun]) -> MotionRun | None:
    """Return the run to compare with: the one of the same motion.

    Raises
    ------
    DataQualityError
        There are several.
    """
    same = [other for other in others if other.motion == run.motion]
    if len(same) > 1:
        raise DataQualityError(
            f"runs {same[0].run_id} and {same[1].run_id} are of the same motion: give --against"
            " once for each"
        )
    return same[0] if same else None


def _document(
    pairs: list[tuple[MotionRun, MotionRun | None]],
    section: TrackingSection,
    joints: tuple[str, ...],
) -> dict[str, object]:
    return {
        "motions": [
            {
                "run": one.run_id,
                "use": motion.use,
                **_sizes(motion.after, joints),
                "against": None
                if before is None or motion.before is None
                else {"run": before.run_id, **_sizes(motion.before, joints)},
                "mean_ratio": motion.mean_ratio,
                "max_ratio": motion.max_ratio,
            }
            for (one, before), motion in zip(pairs, section.motions, strict=True)
        ]
    }


def _sizes(size: ErrorSize, joints: tuple[str, ...]) -> dict[str, object]:
    peaks = dict(zip(joints, size.joint_peak, strict=True))
    return {"mean_m": size.mean_m, "max_m": size.max_m, "joint_peak": peaks}


def _row(motion: FollowedMotion, key: str, ratio: float | None) -> tuple[str, str, str]:
    before = motion.before
    return (
        f"{1e3 * getattr(motion.after, key):.4f}",
        "–" if before is None else f"{1e3 * getattr(before, key):.3f}",
        "–" if ratio is None else f"{ratio:.1f} times",
    )
