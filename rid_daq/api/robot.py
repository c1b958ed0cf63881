"""`Robot`: kinematics, limits and friction terms of a serial robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from config.formats.whole_file import write_whole
from config.load import load_robot, to_yaml
from config.robot.robot import RobotDescription
from rid_daq.api.arguments import as_path, as_paths, as_texts, require
from rid_daq.operations.start.init import InitRequest
from rid_daq.operations.start.urdf_starter import starting_robot
from rid_daq.runs.output_file import require_writable


@dataclass(frozen=True)
class Robot:
    """A serial robot: frames, joint limits, gears, rotors, friction terms and bodies.

    Attributes:
        description: Content of a robot file (docs/reference/files.md).
        notes: Values that a URDF lacks or that were changed; one sentence each.
    """

    description: RobotDescription
    notes: tuple[str, ...] = ()

    @classmethod
    def load(cls, name: str | Path) -> Self:
        """Return a bundled robot, or the robot of a robot file.

        Args:
            name: A bundled name (exercise, ir361, kr15, ur10, ur10e), or the path of a robot file.

        Raises:
            ConfigError: The robot does not exist (RID-FILE-UNKNOWN), or its file is invalid.
        """
        return cls(load_robot(str(as_path("name", name))))

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        packages: Sequence[str | Path] = (),
        parallelograms: Sequence[str] = (),
    ) -> Self:
        """Return the robot of a URDF, as `rid-daq init --urdf` makes it.

        Limits that the URDF does not state follow from the robot's size. Stated limits are changed
        if the motors could not keep them. `notes` lists both.

        Args:
            path: The URDF.
            base: The fixed link; by default the URDF's root.
            tip: The link at the tool point; by default the last link of the arm, before a gripper.
            packages: Folders with the ROS packages that contain the meshes.
            parallelograms: Joints with `<mimic>` that their own motors turn through a
                parallelogram.

        Raises:
            ConfigError: The file cannot be read, is not the URDF of a serial robot, or has several
                arms and `tip` does not choose one (RID-URDF-ARM); a folder of `packages` does not
                exist; or the links leave no space for a motion.
        """
        request = InitRequest.of(
            {
                "folder": Path(),
                "urdf": as_path("path", path),
                "base": base,
                "tip": tip,
                "packages": as_paths("packages", packages),
                "parallelograms": as_texts("parallelograms", parallelograms),
            },
            shown="from_urdf",
        )
        made = starting_robot(request, Path(path))
        return cls(made.robot, made.notes)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to flange."""
        return self.description.joint_names

    def save(self, path: str | Path) -> None:
        """Write the robot file (YAML) without meshes; an existing file is replaced.

        Raises:
            ConfigError: The file belongs to a run.
            RecordingError: The file cannot be written.
        """
        path = as_path("path", path)
        require_writable(path)
        write_whole(path, self.to_text().encode())

    def to_text(self) -> str:
        """Return the robot file (YAML) without meshes."""
        description = self.description.model_copy(update={"meshes": None})
        return to_yaml(description, f"Robot {self.name}.")

    def __str__(self) -> str:
        return f"{self.name}: {len(self.joint_names)} joints ({', '.join(self.joint_names)})"

    def __repr__(self) -> str:
        return str(self)


def as_robot(name: str, value: object) -> Robot:
    """Return the robot of an argument: a `Robot`, a bundled name, or the path of a robot file.

    Raises:
        ConfigError: The argument is none of these, or the file cannot be read.
    """
    if isinstance(value, (str, Path)):
        return Robot.load(as_path(name, value))
    return require(name, value, Robot)
