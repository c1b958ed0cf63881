"""Last pose of a cell: stored after a motion, compared before the next one.

It is stored in this user account's state, by the path of the cell file, so it is kept when drives
and computer are switched off. Simulated devices that a command starts begin in a new pose each time
and are not compared.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Final

from acquisition.motion.known_pose import ADVICE, MOVED, KnownPose
from config.errors import RecordingError, system_errors
from config.formats.json_file import read_json_file
from config.formats.whole_file import write_whole
from config.load import LoadedCell
from config.model import ConfigModel
from config.process.own_state import own_state_folder
from rid_daq.preflight.check_line import CheckLine

LARGEST_FILE_BYTES: Final = 1 << 16
LAST_POSE: Final = "pose compared with the last pose"
"""Name of the preflight's line on the last pose."""

CHECK: Final = "the last check"
_WHAT: Final = "the last pose of a cell"


class PoseRule(Enum):
    """Rule of a preflight for the last pose: compare it, accept any change, or leave it out."""

    COMPARED = "compared"
    ACCEPTED = "accepted"
    LEFT_OUT = "left out"


class LastPose(ConfigModel):
    """Last positions of a cell's joints [rad or m], and the run or check that measured them."""

    cell: str
    joints: tuple[str, ...]
    position: tuple[float, ...]
    seen_by: str
    when_utc: str


def known_pose(loaded: LoadedCell, *, binding: bool) -> KnownPose | None:
    """Return the last known pose of a cell's robot.

    None if no pose is stored, or if the joints have changed.

    Args:
        loaded: The cell.
        binding: True if the robot must not move after a displacement.

    Raises:
        ConfigError, RecordingError: The file of the pose cannot be read.
    """
    last = last_pose(loaded)
    if last is None:
        return None
    return KnownPose(last.position, f"{last.seen_by} ({last.when_utc})", binding)


def last_pose(loaded: LoadedCell) -> LastPose | None:
    """Return the stored pose of a cell's robot; None if there is none for its present joints.

    Raises:
        ConfigError, RecordingError: The file of the pose cannot be read.
    """
    path = _pose_file(loaded)
    if not path.exists():
        return None
    last = read_json_file(path, LastPose, LARGEST_FILE_BYTES, _WHAT)
    names = loaded.robot.joint_names
    return last if last.joints == names and len(last.position) == len(names) else None


def store_pose(loaded: LoadedCell, position: Sequence[float], seen_by: str) -> None:
    """Store the present pose of a cell's robot.

    Args:
        loaded: The cell.
        position: Positions of the joints [rad or m].
        seen_by: Run or check that measured the pose, such as "run 01M8...".

    Raises:
        RecordingError: The file cannot be written.
    """
    path = _pose_file(loaded)
    pose = LastPose(
        cell=loaded.config.name,
        joints=loaded.robot.joint_names,
        position=tuple(float(each) for each in position),
        seen_by=seen_by,
        when_utc=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    with system_errors(
        RecordingError, f"{path.parent}: cannot make this folder", code="RID-FILE-WRITE"
    ):
        path.parent.mkdir(exist_ok=True, mode=0o700)
    write_whole(path, f"{pose.model_dump_json(indent=2)}\n".encode())


def pose_lines(loaded: LoadedCell, position: Sequence[float], rule: PoseRule) -> list[CheckLine]:
    """Compare a robot's pose with the last one; store it if it is the first one or accepted.

    Args:
        loaded: The cell.
        position: Present positions of the joints [rad or m].
        rule: Whether the last pose is compared, replaced by the present one, or left out.

    Raises:
        ConfigError, RecordingError: The file of the pose cannot be read or written.
    """
    if rule is PoseRule.LEFT_OUT:
        return []
    known = known_pose(loaded, binding=not loaded.config.simulated)
    moved = [] if known is None else known.displacements(loaded.robot, position)
    if known is None or rule is PoseRule.ACCEPTED:
        store_pose(loaded, position, CHECK)
    if known is None:
        return [
            CheckLine(
                "robot",
                LAST_POSE,
                "",
                "not verified: first check, without an earlier pose. The drives report"
                f" {_pose_text(loaded, position)}; compare this pose with the marks of the joints"
                " before the first motion",
                "shown",
            )
        ]
    if not moved:
        return [
            CheckLine("robot", LAST_POSE, "not moved", f"same pose as after {known.source}", "ok")
        ]
    if rule is PoseRule.ACCEPTED:
        found = f"accepted: {known.sentence(moved)}"
        return [CheckLine("robot", LAST_POSE, "not moved", found, "allowed")]
    red = known.binding
    return [
        CheckLine(
            where="robot",
            what=LAST_POSE,
            required="not moved",
            found=known.sentence(moved),
            verdict="red" if red else "allowed",
            next_action=ADVICE if red else "",
            code=MOVED if red else "",
        )
    ]


def _pose_text(loaded: LoadedCell, position: Sequence[float]) -> str:
    """Return the joints' positions in degrees or millimetres."""
    shown = []
    for joint, value in zip(loaded.robot.joints, position, strict=True):
        linear = joint.type == "prismatic"
        shown.append(
            f"{joint.name} {1e3 * value:.1f} mm"
            if linear
            else f"{joint.name} {math.degrees(value):.1f}°"
        )
    return ", ".join(shown)


def _pose_file(loaded: LoadedCell) -> Path:
    named = loaded.config.name if loaded.path is None else str(loaded.path.resolve())
    name = hashlib.sha256(named.encode()).hexdigest()
    return own_state_folder() / "last-poses" / f"{name}.json"
