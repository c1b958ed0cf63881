"""`rid-daq tracking`: how far the robot was from where it should have been, before and after."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError, DataQualityError
from rid_daq.report.render import number
from rid_daq.report.result import verdict, write_result
from rid_daq.runs.motion_runs import MotionRun, read_motion_run
from rid_daq.runs.run_data import Unfinished, result_of, tell_lacks
from rid_daq.runs.tracking_section import followed, tracking_section
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
    notes = tell_lacks(console, [one.data for one in (*driven, *others)])
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
    section = tracking_section([followed(*pair) for pair in pairs], robot)
    result = result_of(driven[0].data, notes)
    result["title"] = f"Paths of {robot.name}"
    result["tracking"] = section
    result["verdict"] = verdict([], *_sentences(section))
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
                motion["use"],
                *_row(motion, "mean"),
                *_row(motion, "max"),
            )
            for (one, _), motion in zip(pairs, section["motions"], strict=True)
        ],
    )
    console.verdict(None, result["verdict"]["headline"])
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


def _sentences(section: dict[str, Any]) -> tuple[str, str]:
    """Return what the report says first."""
    after = [motion["after"]["mean_m"] for motion in section["motions"]]
    ratios = [motion["mean_ratio"] for motion in section["motions"] if motion["mean_ratio"]]
    mean = f"Mean distance from the path {number(1e3 * max(after), 3)} mm"
    mean += " at most" if len(after) > 1 else ""
    if not ratios:
        return mean, "No run without compensation was given to compare with."
    least = number(min(ratios), 3)
    return (
        f"{mean}, {least} times closer than before" + (" at least" if len(ratios) > 1 else ""),
        "Before is velocity feedforward alone, after is with pre-compensation.",
    )


def _document(
    pairs: list[tuple[MotionRun, MotionRun | None]],
    section: dict[str, Any],
    joints: tuple[str, ...],
) -> dict[str, Any]:
    motions = []
    for (one, before), motion in zip(pairs, section["motions"], strict=True):
        motions.append(
            {
                "run": one.run_id,
                "use": motion["use"],
                **_sizes(motion["after"], joints),
                "against": None
                if before is None
                else {"run": before.run_id, **_sizes(motion["before"], joints)},
                "mean_ratio": motion["mean_ratio"],
                "max_ratio": motion["max_ratio"],
            }
        )
    return {"motions": motions}


def _sizes(size: dict[str, Any], joints: tuple[str, ...]) -> dict[str, Any]:
    return size | {"joint_peak": dict(zip(joints, size["joint_peak"], strict=True))}


def _row(motion: dict[str, Any], key: str) -> tuple[str, str, str]:
    before = motion["before"]
    return (
        f"{1e3 * motion['after'][f'{key}_m']:.4f}",
        "–" if before is None else f"{1e3 * before[f'{key}_m']:.3f}",
        "–" if before is None else f"{motion[f'{key}_ratio']:.1f} times",
    )
