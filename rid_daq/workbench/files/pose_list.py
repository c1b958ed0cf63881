"""`PoseList`: a motion through poses that a person chooses in the 3-D view."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from pydantic import Field, FiniteFloat

from acquisition.motion.kinds.pose_sequence import reachable_poses
from acquisition.motion.motion_file import AnyMotion
from config.errors import ConfigError
from config.formats.yaml_tree import dump_yaml
from config.robot.robot import RobotDescription
from rid_daq.service.records import Record
from rid_daq.workbench.files.pose_forms import FORMS, Kind

DIGITS: Final = 5
"""Decimals of positions in rad or m: 0.001° and 0.01 mm."""

MOST: Final = 200
"""Largest number of poses."""


class PoseList(Record):
    """Poses and settings of a motion.

    Attributes:
        kind: Kind of the motion.
        points: Poses, each with one position per joint [rad or m].
        settings: Values of the other keys of the motion file, in its units.
    """

    kind: Kind
    points: Annotated[tuple[tuple[float, ...], ...], Field(min_length=1, max_length=MOST)]
    settings: dict[str, FiniteFloat | tuple[FiniteFloat, ...]]

    @classmethod
    def of(cls, motion: AnyMotion, robot: RobotDescription) -> PoseList | None:
        """Return the poses of a motion, or None if poses and settings cannot describe it.

        It must consist of at most `MOST` poses that the robot can reach, and every key that is no
        setting must have its default.
        """
        form = FORMS.get(motion.kind)
        found = None if form is None else motion.chosen_poses(robot, MOST)
        if form is None or found is None:
            return None
        settings = {each.key: getattr(motion, each.key) for each in form.settings}
        known = {"kind", "robot", *form.places, *settings}
        if not all(
            getattr(motion, name) == field.default
            for name, field in type(motion).model_fields.items()
            if name not in known
        ) or not all(each.allows(settings[each.key]) for each in form.settings):
            return None
        return cls.model_validate({"kind": motion.kind, "points": found, "settings": settings})

    def text(self, robot: RobotDescription) -> str:
        """Return the motion as the text of a motion file.

        Raises:
            ConfigError: A pose has another number of joints, there are too many poses for this kind
                of motion, or a setting is missing or unknown.
            LimitError: A pose is outside the limits.
        """
        form = FORMS[self.kind]
        keys = {each.key for each in form.settings}
        if keys != self.settings.keys():
            raise ConfigError(
                f"settings {', '.join(sorted(self.settings))}: a motion of kind {self.kind} has"
                f" {', '.join(sorted(keys))}",
                code="RID-REQUEST-INVALID",
            )
        if form.most is not None and len(self.points) > form.most:
            raise ConfigError(
                f"{len(self.points)} poses: this motion has at most {form.most}. Remove the others",
                code="RID-PATH-SEGMENT",
            )
        points = np.atleast_2d(reachable_poses(self.points, robot)).round(DIGITS)
        document: dict[str, object] = {"kind": self.kind, "robot": robot.name}
        document |= {key: _plain(value) for key, value in self.settings.items()}
        document |= form.geometry(points, robot, DIGITS)
        return dump_yaml(document, "Poses that were chosen in the workbench.")


def _plain(value: float | tuple[float, ...]) -> object:
    """Return a value as it is written in a file: whole numbers without decimals."""
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return int(value) if value.is_integer() else value
