"""`FORMS`: forms of the motions that a person makes from poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward

Kind = Literal["pose_sequence", "joint_path", "path", "circle"]
Value = float | tuple[float, ...]
Geometry = Callable[[FloatArray, RobotDescription, int], dict[str, object]]
"""Function of poses, robot and number of decimals; it returns keys of the motion file."""


@dataclass(frozen=True)
class Setting:
    """A value that a person enters beside the poses.

    Attributes:
        key: Key of the motion file.
        label: Name and unit on the page.
        initial: Initial value, in the file's unit.
        factor: Value on the page divided by the value in the file.
        choices: Labels and values of a selection; empty if a number is entered.
    """

    key: str
    label: str
    initial: Value
    factor: float = 1.0
    choices: tuple[tuple[str, Value], ...] = ()

    def allows(self, value: Value) -> bool:
        """Return True if the value can be entered."""
        return not self.choices or value in dict(self.choices).values()


@dataclass(frozen=True)
class PoseForm:
    """Form of a kind of motion.

    Attributes:
        label: Name of the motion on the page.
        settings: Values that are entered beside the poses.
        geometry: Function that returns the other keys.
        places: The other keys.
        hint: Meaning of the poses; empty if the label says it.
        keeps_orientation: True if a tool of a robot with other than three joints keeps its
            orientation.
        most: Largest number of poses; None for any number.
    """

    label: str
    settings: tuple[Setting, ...]
    geometry: Geometry
    places: tuple[str, ...]
    hint: str = ""
    keeps_orientation: bool = False
    most: int | None = None

    def hint_for(self, robot: RobotDescription) -> str:
        """Return the hint for a robot."""
        kept = "The tool keeps the orientation of the first pose."
        words = (self.hint, kept if self.keeps_orientation and len(robot.joints) != 3 else "")
        return " ".join(filter(None, words))


def _joint_points(points: FloatArray, robot: RobotDescription, digits: int) -> dict[str, object]:
    return {"points": points.tolist()}


def _tool_points(points: FloatArray, robot: RobotDescription, digits: int) -> list[list[float]]:
    tool = forward(Chain.from_description(robot), points).round(digits) + 0.0
    found: list[list[float]] = tool.tolist()
    return found


def _tool_lines(points: FloatArray, robot: RobotDescription, digits: int) -> dict[str, object]:
    start, *ends = _tool_points(points, robot, digits)
    segments = [{"kind": "line", "to_m": end} for end in ends]
    return {"start_m": start, "near": points[0].tolist(), "segments": segments}


def _tool_circle(points: FloatArray, robot: RobotDescription, digits: int) -> dict[str, object]:
    (centre,) = _tool_points(points, robot, digits)
    return {"centre_m": centre, "near": points[0].tolist()}


_JOINT_SPEED: Final = "Speed [% of the joints' limits]"
_TOOL_SPEED: Final = Setting("speed_m_s", "Speed of the tool point [mm/s]", 0.1, 1000.0)
_PLANES: Final = (
    ("horizontal: x and y of the base", (0.0, 0.0, 1.0)),
    ("vertical: y and z of the base", (1.0, 0.0, 0.0)),
    ("vertical: z and x of the base", (0.0, 1.0, 0.0)),
)

FORMS: Final[Mapping[str, PoseForm]] = MappingProxyType(
    {
        "pose_sequence": PoseForm(
            "Rests at the poses",
            (
                Setting("speed_fraction", _JOINT_SPEED, 0.3, 100.0),
                Setting("dwell_s", "Rest at each pose [s]", 5.0),
            ),
            _joint_points,
            ("points",),
        ),
        "joint_path": PoseForm(
            "Curve through the poses",
            (
                Setting("speed_fraction", _JOINT_SPEED, 0.5, 100.0),
                Setting("dwell_s", "Rest at both ends [s]", 0.2),
            ),
            _joint_points,
            ("points",),
        ),
        "path": PoseForm(
            "Straight lines of the tool point",
            (_TOOL_SPEED, Setting("dwell_s", "Rest at each corner [s]", 0.2)),
            _tool_lines,
            ("start_m", "near", "segments"),
            keeps_orientation=True,
        ),
        "circle": PoseForm(
            "Circle of the tool point",
            (
                Setting("radius_m", "Radius [mm]", 0.05, 1000.0),
                Setting("normal", "Plane", (0.0, 0.0, 1.0), choices=_PLANES),
                _TOOL_SPEED,
                Setting("periods", "Turns", 15.0),
            ),
            _tool_circle,
            ("centre_m", "near"),
            hint="The tool point of the pose is the centre of the circle.",
            keeps_orientation=True,
            most=1,
        ),
    }
)
"""Form of each kind of motion; the keys are the values of `Kind`."""
