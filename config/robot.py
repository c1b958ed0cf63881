"""`RobotDescription`: what is known of a robot before anything is measured."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel

Vector3 = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]

JointType = Literal["revolute", "prismatic"]
FrictionTerm = Literal["coulomb", "viscous", "offset", "cubic", "cube_root"]


class KinematicRow(ConfigModel):
    """One row of a Denavit-Hartenberg table, angles in rad, lengths in m.

    `theta_rad` (revolute) or `d_m` (prismatic) is the constant that the joint position is added
    to. `beta_rad` is Hayati's angle for nearly parallel axes (physics: section 1); it exists in the
    modified convention only.
    """

    alpha_rad: float = 0.0
    beta_rad: float = 0.0
    theta_rad: float = 0.0
    a_m: float = 0.0
    d_m: float = 0.0


class Kinematics(ConfigModel):
    """A table of rows, base to flange.

    In the modified convention frame i-1 becomes frame i by
    Rot_x(alpha) Trans_x(a) Rot_y(beta) Rot_z(theta) Trans_z(d), all of row i; in the standard
    convention by Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha).
    """

    convention: Literal["modified_dh", "standard_dh"]
    rows: tuple[KinematicRow, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _beta_needs_modified(self) -> Kinematics:
        if self.convention == "standard_dh" and any(row.beta_rad for row in self.rows):
            raise ValueError("beta_rad exists in the modified_dh convention only")
        return self

    def modified_rows(self) -> tuple[KinematicRow, ...]:
        """Return the rows in the modified convention.

        A standard table is shifted by half a row: frame i then sits on axis i, and the last
        `a_m` and `alpha_rad` (from axis n to the flange) are left out, since no link's motion
        depends on them.
        """
        if self.convention == "modified_dh":
            return self.rows
        before = (KinematicRow(), *self.rows[:-1])
        return tuple(
            KinematicRow(
                alpha_rad=previous.alpha_rad,
                a_m=previous.a_m,
                theta_rad=row.theta_rad,
                d_m=row.d_m,
            )
            for previous, row in zip(before, self.rows, strict=True)
        )


class JointLimits(ConfigModel):
    """What a joint must not exceed; rad or m, per second, N m or N at the link side."""

    position_min: float
    position_max: float
    velocity: Positive
    acceleration: Positive
    torque: Positive

    @model_validator(mode="after")
    def _ordered(self) -> JointLimits:
        if self.position_min >= self.position_max:
            raise ValueError(
                f"position_min {self.position_min} must be below position_max {self.position_max}"
            )
        return self


class Rotor(ConfigModel):
    """Where a motor's rotor sits and which way it spins (physics: section 3).

    `link` is the carrying link, 0 for the base; `axis` is the spin axis in that link's frame, in
    the sense in which a positive `gear_ratio` turns for positive joint velocity. A motor may ride
    on the very link that it moves (`link` equal to its joint's number).
    """

    link: Annotated[int, Field(ge=0)]
    axis: Vector3

    @model_validator(mode="after")
    def _unit_vector(self) -> Rotor:
        norm = sum(c * c for c in self.axis) ** 0.5
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(f"axis must be a unit vector, its length is {norm:.6g}")
        return self


class Joint(ConfigModel):
    """One joint: its kind, limits, gear and what its model contains."""

    name: str = Field(pattern=r"^[A-Za-z][\w-]{0,31}$")
    type: JointType = "revolute"
    limits: JointLimits
    gear_ratio: float = 1.0
    rotor: Rotor | None = None
    torque_constant_nm_per_a: Positive | None = None
    friction: tuple[FrictionTerm, ...] = ("coulomb", "viscous")

    @model_validator(mode="after")
    def _checks(self) -> Joint:
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio must not be 0")
        if len(set(self.friction)) != len(self.friction):
            raise ValueError("friction names a term twice")
        return self


class GravitySpring(ConfigModel):
    """A gravity-compensation spring across one joint (3.36-3.38), angle zero with the link up."""

    joint: str
    l_m: Positive
    r_m: Positive


class RobotDescription(ConfigModel):
    """A serial robot: kinematics, joints, rotors, spring, gravity. Inertias are measured."""

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    gravity_m_s2: Vector3 = (0.0, 0.0, -9.81)
    kinematics: Kinematics
    tool_offset_m: Vector3 = (0.0, 0.0, 0.0)
    joints: tuple[Joint, ...] = Field(min_length=1)
    spring: GravitySpring | None = None

    @model_validator(mode="after")
    def _consistent(self) -> RobotDescription:
        if len(self.kinematics.rows) != len(self.joints):
            raise ValueError(
                f"kinematics has {len(self.kinematics.rows)} rows for {len(self.joints)} joints"
            )
        names = self.joint_names
        if len(set(names)) != len(names):
            raise ValueError("two joints have the same name")
        if self.spring is not None and self.spring.joint not in names:
            raise ValueError(
                f"spring.joint {self.spring.joint!r} is not a joint; joints are {', '.join(names)}"
            )
        for number, joint in enumerate(self.joints, start=1):
            if joint.rotor is not None and joint.rotor.link > number:
                raise ValueError(
                    f"rotor of joint {joint.name!r} sits on link {joint.rotor.link}: it must sit on"
                    f" the base (0), on a link before its joint, or on link {number} that it moves"
                )
        return self

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints' names, base to flange."""
        return tuple(joint.name for joint in self.joints)
