"""`PoseList`: a motion through poses that a person chooses in the 3-D view."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.kinds.pose_sequence import reachable_poses
from acquisition.motion.motion_file import AnyMotion
from config.formats.yaml_tree import dump_yaml
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.service.records import Record

DIGITS: Final = 5
"""Decimals of positions in rad or m: 0.001° and 0.01 mm."""

MOST: Final = 200
"""Largest number of poses."""

Kind = Literal["pose_sequence", "joint_path", "path"]


class PoseList(Record):
    """Poses and settings of a motion.

    Attributes:
        kind: Kind of the motion: rests at the poses, a curve through them, or straight lines of the
            tool point.
        points: Poses, each with one position per joint [rad or m].
        speed: Fraction of the joints' limits; for straight lines the speed of the tool point [m/s].
        dwell_s: Rest at each pose; for a curve or lines only at both ends [s].
    """

    kind: Kind
    points: Annotated[tuple[tuple[float, ...], ...], Field(min_length=1, max_length=MOST)]
    speed: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    dwell_s: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]

    @classmethod
    def of(cls, motion: AnyMotion, robot: RobotDescription) -> PoseList | None:
        """Return the poses of a motion, or None if a list of poses cannot describe it.

        It must consist of at most `MOST` poses or straight lines of the tool, whose points the
        robot can reach.
        """
        found = motion.chosen_poses(robot, MOST)
        if found is None:
            return None
        return cls.model_validate({"kind": motion.kind, **asdict(found)})

    def text(self, robot: RobotDescription) -> str:
        """Return the motion as the text of a motion file.

        Raises:
            ConfigError, LimitError: A pose has another number of joints, or is outside the limits.
        """
        points = np.atleast_2d(reachable_poses(self.points, robot)).round(DIGITS)
        document: dict[str, object] = {
            "kind": self.kind,
            "robot": robot.name,
            "dwell_s": self.dwell_s,
        }
        if self.kind == "path":
            tool = (forward(Chain.from_description(robot), points).round(DIGITS) + 0.0).tolist()
            document |= {"start_m": tool[0], "near": points[0].tolist(), "speed_m_s": self.speed}
            document["segments"] = [{"kind": "line", "to_m": point} for point in tool[1:]]
        else:
            document |= {"speed_fraction": self.speed, "points": points.tolist()}
        return dump_yaml(document, "Poses that were chosen in the workbench.")
