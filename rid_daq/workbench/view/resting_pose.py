"""`RestingPose`: newest known pose of a robot that does not move."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from config.load import LoadedCell
from rid_daq.preflight.last_pose import last_pose
from rid_daq.service.records import Preflight


@dataclass(frozen=True)
class RestingPose:
    """A pose that was measured some time ago; the robot may have been moved since.

    Attributes:
        position: Positions of the joints [rad or m]; None if no pose is known.
        source: What measured it, such as "the preflight".
        at_s: Time of the measurement [s since 1970]; None if no pose is known.
    """

    position: tuple[float, ...] | None = None
    source: str = ""
    at_s: float | None = None

    def document(self) -> dict[str, object]:
        """Return the pose as a JSON object for the pages."""
        return asdict(self)


def resting_pose(loaded: LoadedCell, preflight: Preflight | None) -> RestingPose:
    """Return the newer of two poses: at the newest preflight, and at the end of the last motion.

    Args:
        loaded: The cell.
        preflight: The cell's newest preflight; None if there is none.

    Raises:
        RecordingError: The file of the last pose cannot be read.
    """
    found = [pose for pose in (_at_preflight(loaded, preflight), _at_last_motion(loaded)) if pose]
    return max(found, key=lambda pose: pose.at_s or 0.0, default=RestingPose())


def _at_preflight(loaded: LoadedCell, preflight: Preflight | None) -> RestingPose | None:
    """Return the pose at a preflight; None if it did not measure the position of every joint."""
    if preflight is None:
        return None
    measured = {
        line.where.partition(",")[0]: line.position
        for line in preflight.lines
        if line.position is not None
    }
    if set(measured) != set(loaded.robot.joint_names):
        return None
    position = tuple(measured[name] for name in loaded.robot.joint_names)
    return RestingPose(position, "the preflight", preflight.at_s)


def _at_last_motion(loaded: LoadedCell) -> RestingPose | None:
    last = last_pose(loaded)
    if last is None:
        return None
    at = datetime.fromisoformat(last.when_utc).astimezone(UTC)
    is_run = last.seen_by.startswith("run ")  # pages show no ids
    source = "the last motion" if is_run else last.seen_by
    return RestingPose(last.position, source, at.timestamp())
