"""What `rid-daq tracking` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.tracking_job import Tracked, TrackingRequest, track_runs
from rid_daq.report.sections.tracking import ENCODERS_AT_MOTORS, ErrorSize, FollowedMotion
from rid_daq.terminal.console import Console


def perform(request: TrackingRequest, console: Console) -> None:
    """Say how far the robot was from its path."""
    _print(console, track_runs(request, console))


def _print(console: Console, tracked: Tracked) -> None:
    console.document(
        {
            "motions": _motions(tracked),
            "measured_at": "motor encoders",
            "unseen": tracked.section.unseen,
            "with_stiffness": tracked.section.with_stiffness,
            "without_stiffness": tracked.section.without_stiffness,
            "notes": tracked.notes,
            "report": str(tracked.report),
        }
    )
    console.table(
        (
            "motion",
            "its own runs",
            "mean [mm]",
            "before",
            "reduced",
            "largest [mm]",
            "before",
            "reduced",
        ),
        [
            (
                one.data.folder.manifest().label,
                motion.use,
                *_row(motion, "mean_m", motion.mean_ratio),
                *_row(motion, "max_m", motion.max_ratio),
            )
            for (one, _), motion in zip(tracked.pairs, tracked.section.motions, strict=True)
        ],
    )
    console.verdict(None, tracked.section.verdict.headline)
    console.say(tracked.section.unseen or ENCODERS_AT_MOTORS)
    console.say(f"Report: {tracked.report}")


def _motions(tracked: Tracked) -> list[dict[str, object]]:
    joints = tracked.pairs[0][0].data.robot.joint_names
    return [
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
        for (one, before), motion in zip(tracked.pairs, tracked.section.motions, strict=True)
    ]


def _sizes(size: ErrorSize, joints: tuple[str, ...]) -> dict[str, object]:
    peaks = dict(zip(joints, size.joint_peak, strict=True))
    bending = None if size.bending is None else size.bending.model_dump()
    return {
        "mean_m": size.mean_m,
        "max_m": size.max_m,
        "joint_peak": peaks,
        "bending": bending,
    }


def _row(motion: FollowedMotion, key: str, ratio: float | None) -> tuple[str, str, str]:
    before = motion.before
    return (
        f"{1e3 * getattr(motion.after, key):.4f}",
        "–" if before is None else f"{1e3 * getattr(before, key):.3f}",
        "–" if ratio is None else f"{ratio:.1f} times",
    )
