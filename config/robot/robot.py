"""`RobotDescription`: the robot as known before a measurement."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from config.model import ConfigModel, refuse_same_names
from config.plausible import SLIDE_UP_UNIT, SPEED_UP_UNIT, Derived, PhysicalFile, Plausible
from config.quantities import (
    MOST_JOINTS,
    NonNegative,
    Place,
    Positive,
    Temperature,
    Turn,
    Vector3,
)
from config.robot.bodies import Body, refuse_unknown_pairs
from config.robot.friction_terms import FrictionTerm
from config.robot.kinematic_table import Kinematics
from config.robot.link_cad import LinkCad
from config.robot.meshes_file import MeshesFile

JointPosition = Annotated[float, Plausible(0.0, 15.0, "rad", Plausible(0.0, 50.0, "m"))]
JointVelocity = Annotated[Positive, Plausible(1e-3, 60.0, "rad/s", Plausible(1e-3, 20.0, "m/s"))]
JointAcceleration = Annotated[
    Positive, Plausible(1e-2, 1e3, "rad/s²", Plausible(1e-2, 500.0, "m/s²"))
]
JointTorque = Annotated[Positive, Plausible(1e-2, 2e5, "N m", Plausible(0.1, 5e5, "N"))]

SPEED_UP: Final = Plausible(0.04, 60.0, SPEED_UP_UNIT, Plausible(0.005, 60.0, SLIDE_UP_UNIT))
"""Time in which a joint reaches its largest velocity.

Robots need 0.05 s to 2 s. An acceleration that was entered in degrees/s^2 (or mm/s^2) gives 0.001 s
to 0.035 s (or at most 0.002 s)."""
WORST_COUPLING: Final = 1e6
CouplingElement = Annotated[float, Plausible(1e-3, 100.0, "")]

_IDENTITY: Final = ("name", "gravity_m_s2", "kinematics", "spring", "coupling")
_JOINT_IDENTITY: Final = (
    *("name", "type", "gear_ratio"),
    *("torque_constant_nm_per_a", "torque_constant_per_k"),
)

JointType = Literal["revolute", "prismatic"]


class JointLimits(Derived):
    """Limits of a joint, at the link side.

    With a `coupling`, position and acceleration are the joint's, torque is its motor's, and
    velocity limits both.

    Attributes:
        position_min: Lowest position [rad or m].
        position_max: Highest position [rad or m].
        velocity: Largest speed [rad/s or m/s].
        acceleration: Largest acceleration [rad/s^2 or m/s^2].
        torque: Largest torque or force [N m or N].
    """

    position_min: JointPosition
    position_max: JointPosition
    velocity: JointVelocity
    acceleration: JointAcceleration
    torque: JointTorque

    @model_validator(mode="after")
    def _check_order(self) -> JointLimits:
        if self.position_min >= self.position_max:
            raise ValueError(
                f"position_min {self.position_min} must be below position_max {self.position_max}"
            )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the joint's range, and the time in which it reaches its largest velocity."""
        return {
            "position_range": (
                self.position_max - self.position_min,
                Plausible(1e-3, 1e4, "rad or m"),
            ),
            "acceleration_time_s": (self.velocity / self.acceleration, SPEED_UP),
        }


class Rotor(ConfigModel):
    """Mounting and spin direction of a motor's rotor (theory: section 3).

    Attributes:
        link: The link that carries the motor, 0 for the base. A motor may be mounted on the link
            that it moves: then it is the joint's own number.
        axis: Spin axis in that link's frame: a positive `gear_ratio` spins the rotor about it if
            the joint's velocity is positive.
    """

    link: Annotated[int, Field(ge=0)]
    axis: Vector3

    @model_validator(mode="after")
    def _check_axis(self) -> Rotor:
        norm = sum(c * c for c in self.axis) ** 0.5
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(
                f"axis must be a unit vector, its length is {norm:.6g}; divide it by its length"
            )
        return self


class Joint(Derived):
    """One joint: its kind, limits, gear and model terms.

    Attributes:
        name: Name of the joint.
        type: Kind of joint.
        limits: Limits of position, velocity, acceleration and torque.
        gear_ratio: Motor turns per joint turn (rad per m of a prismatic joint).
        rotor: Mounting of the motor, if it is known.
        torque_constant_nm_per_a: Torque at the link side, gear included, per ampere of the motor,
            at `reference_temperature_k`.
        torque_constant_per_k: Relative change of the torque constant per kelvin (magnets: about
            -0.001 1/K), which drives do not know.
        friction: Terms of the joint's friction (theory: section 4). `asymmetric` is Coulomb
            friction with a value for each direction. With `temperature`, Coulomb and viscous
            friction change linearly with the difference from `reference_temperature_k`. `load`
            grows with the torque that the gear transmits. `presliding` is presliding hysteresis
            (section 4.1).
        stribeck_velocity: Initial value of the estimate [rad/s or m/s].
        shear_thinning_velocity: Speed v_T of the friction term `shear_thinning` [rad/s or m/s]. It
            is not estimated.
        presliding_distance: Initial value of the estimated presliding displacement [rad or m].
        presliding_share: Initial value of the fraction of the friction that has hysteresis; the
            rest is rigid. At 1 all friction has hysteresis, and the fraction is not estimated.
        reference_temperature_k: Temperature at which torque constant and friction are stated.
        armature: Adds the rotor inertia mu^2 I_M (mu: `gear_ratio`) at the link side, for a motor
            whose mounting is not known; if it is known, `rotor` is the better model.
        stiffness_nm_rad: Torsional stiffness of gear and bearings at the gear's output [N m/rad;
            N/m of a prismatic joint]. Encoders at the motors do not measure this deflection:
            `stiffness` identifies it, `tracking` estimates the tool's error, and `compensate`
            corrects it.
        damping_nm_s: Damping of gear and bearings parallel to the stiffness [N m s/rad; N s/m of a
            prismatic joint].
        motor_inertia_kg_m2: Inertia of the motor at the gear's output, without links [kg m^2; kg of
            a prismatic joint]. `compensate` and `tracking` use it if the model cannot separate it
            from the links, because the gear does not transmit the torque that it needs.
        efficiency: Initial value of the gear's efficiency (5.16, 5.17); without it the gear is
            lossless.
        counterbalanced: A cylinder or counterweight carries an unknown part of the weight on this
            prismatic joint. The friction term `offset` contains this force, and `identify` does not
            judge the weight.
    """

    name: str = Field(pattern=r"^[A-Za-z][\w-]{0,31}$")
    type: JointType = "revolute"
    limits: JointLimits
    gear_ratio: Annotated[float, Plausible(0.05, 5e3, "", Plausible(0.05, 1e5, "rad/m"))] = 1.0
    rotor: Rotor | None = None
    torque_constant_nm_per_a: Annotated[Positive, Plausible(1e-3, 5e3, "N m/A")] | None = None
    torque_constant_per_k: Annotated[float, Field(ge=-0.01, le=0.01)] = 0.0
    friction: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
    stribeck_velocity: Annotated[
        Positive, Plausible(1e-5, 10.0, "rad/s", Plausible(1e-5, 10.0, "m/s"))
    ] = 0.05
    shear_thinning_velocity: Annotated[
        Positive, Plausible(1e-3, 10.0, "rad/s", Plausible(1e-3, 10.0, "m/s"))
    ] = 0.5
    presliding_distance: Annotated[Positive, Plausible(1e-7, 0.2, "rad")] = 1e-3
    presliding_share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    reference_temperature_k: Temperature = 298.15
    armature: bool = False
    stiffness_nm_rad: (
        Annotated[Positive, Plausible(10.0, 1e9, "N m/rad", Plausible(10.0, 1e12, "N/m"))] | None
    ) = None
    damping_nm_s: (
        Annotated[NonNegative, Plausible(0.0, 1e6, "N m s/rad", Plausible(0.0, 1e9, "N s/m"))]
        | None
    ) = None
    motor_inertia_kg_m2: (
        Annotated[Positive, Plausible(1e-7, 1e4, "kg m²", Plausible(1e-6, 1e6, "kg"))] | None
    ) = None
    efficiency: Annotated[float, Field(gt=0.0, le=1.0), Plausible(0.05, 1.0, "")] | None = None
    counterbalanced: bool = False

    @property
    def unit(self) -> str:
        """Unit of the joint's position."""
        return "rad" if self.type == "revolute" else "m"

    @property
    def torque_unit(self) -> str:
        """Unit of the joint's torque or force."""
        return "N m" if self.type == "revolute" else "N"

    @model_validator(mode="after")
    def _checks(self) -> Joint:
        if self.gear_ratio == 0.0:
            raise ValueError("gear_ratio is 0; give motor turns per joint turn")
        if len(set(self.friction)) != len(self.friction):
            raise ValueError("friction names a term twice; remove one")
        for twice in ("coulomb", "offset"):
            if {"asymmetric", twice} <= set(self.friction):
                raise ValueError(
                    f"friction names asymmetric and {twice}; remove {twice}, because asymmetric"
                    " already contains coulomb and offset"
                )
        if self.efficiency is not None and "load" in self.friction:
            raise ValueError(
                "efficiency and the friction term load both model the gear's losses; remove one"
            )
        if self.damping_nm_s is not None and self.stiffness_nm_rad is None:
            raise ValueError("damping_nm_s needs an elastic gear; add stiffness_nm_rad")
        if self.counterbalanced and self.type == "revolute":
            raise ValueError("counterbalanced is for prismatic joints; use spring for this joint")
        if self.counterbalanced and not {"offset", "asymmetric"} & set(self.friction):
            raise ValueError("counterbalanced needs the friction term offset; add it to friction")
        if self.armature and self.rotor is not None:
            raise ValueError("armature and rotor both add the rotor's inertia; remove one")
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the motor's speed and current at the joint's limits."""
        speed = abs(self.gear_ratio) * self.limits.velocity
        found = {"motor_speed_rad_s": (speed, Plausible(1e-3, 6e3, "rad/s"))}
        if self.torque_constant_nm_per_a is not None:
            current = self.limits.torque / self.torque_constant_nm_per_a
            found["current_at_torque_limit_a"] = (current, Plausible(1e-2, 3e3, "A"))
        return found


class GravitySpring(ConfigModel):
    """A gravity-compensation spring across one joint (theory: equations 3.36 to 3.38).

    At angle zero the link points up.

    Attributes:
        joint: Name of the joint.
        form: `physical` needs the distances `l_m` and `r_m`; if they are not known, `fourier`
            (3.37) fits three harmonics of the angle.
        l_m: Distance of one end of the spring from the axis.
        r_m: Distance of the other end of the spring from the axis.
    """

    joint: str
    form: Literal["physical", "fourier"] = "physical"
    l_m: Annotated[Positive, Plausible(1e-3, 5.0, "m")] | None = None
    r_m: Annotated[Positive, Plausible(1e-3, 5.0, "m")] | None = None

    @model_validator(mode="after")
    def _check_distances(self) -> GravitySpring:
        if self.form == "physical" and (self.l_m is None or self.r_m is None):
            raise ValueError("a physical spring needs l_m and r_m; give them, or use form: fourier")
        return self


class RobotDescription(PhysicalFile, Derived):
    """A serial robot: kinematics, joints, rotors, spring, gravity. Its inertias are identified.

    Attributes:
        name: Name of the robot.
        gravity_m_s2: Acceleration of gravity in the base frame.
        base_offset_m: Origin of frame 0 in the frame of the whole robot; both have the same axes.
            It matters only for exports.
        kinematics: The Denavit-Hartenberg table.
        tool_offset_m: The tool point in the last frame.
        tool_rpy_rad: Rotation of the tool's frame relative to the last frame (roll, pitch, yaw as
            in a URDF). It matters for the frame of payloads, and for exports.
        rated_payload_kg: The maker's rated payload: an identified payload is compared with it or,
            without it, with the weight of `cad`.
        joints: The joints, base to flange.
        spring: A gravity-compensation spring.
        coupling: C of q = C alpha (5.18), for wrists whose motors move several joints; alpha are
            the motors' angles divided by their gear ratios.
        cad: Drawing data of the links, base to flange; it is a prior, never a result.
        bodies: The space that the links occupy.
        may_touch: Pairs of bodies that are not checked against each other, because they touch by
            design.
        meshes: File with the meshes of the links, for drawings.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    gravity_m_s2: Annotated[Vector3, Plausible(9.7, 9.9, "m/s²", zero=False)] = (0.0, 0.0, -9.81)
    base_offset_m: Place = (0.0, 0.0, 0.0)
    kinematics: Kinematics
    tool_offset_m: Place = (0.0, 0.0, 0.0)
    tool_rpy_rad: Turn = (0.0, 0.0, 0.0)
    rated_payload_kg: Annotated[Positive, Plausible(1e-3, 2.5e3, "kg")] | None = None
    joints: tuple[Joint, ...] = Field(min_length=1, max_length=MOST_JOINTS)
    spring: GravitySpring | None = None
    coupling: tuple[tuple[CouplingElement, ...], ...] | None = None
    cad: tuple[LinkCad, ...] | None = None
    bodies: tuple[Body, ...] = ()
    may_touch: tuple[tuple[str, str], ...] = ()
    meshes: MeshesFile | None = None

    @field_validator("coupling")
    @classmethod
    def _check_coupling(
        cls, coupling: tuple[tuple[float, ...], ...] | None, others: ValidationInfo
    ) -> tuple[tuple[float, ...], ...] | None:
        n = len(others.data.get("joints", ()))
        if coupling is None or not n:
            return coupling
        if [len(row) for row in coupling] != [n] * n:
            raise ValueError(f"coupling must have {n} rows of {n} numbers, one per joint")
        if np.linalg.cond(np.array(coupling)) > WORST_COUPLING:
            raise ValueError("coupling cannot be inverted; q = C alpha needs a regular matrix")
        return coupling

    @field_validator("cad")
    @classmethod
    def _check_cad(
        cls, cad: tuple[LinkCad, ...] | None, others: ValidationInfo
    ) -> tuple[LinkCad, ...] | None:
        n = len(others.data.get("joints", ()))
        if cad is not None and n and len(cad) != n:
            raise ValueError(f"cad has {len(cad)} links for {n} joints; list one per joint")
        return cad

    @model_validator(mode="after")
    def _check_joints(self) -> RobotDescription:
        n = len(self.joints)
        for body in self.bodies:
            if body.link > n:
                raise ValueError(
                    f"a body sits on link {body.link}, but the last link is {n}; correct the number"
                )
        refuse_unknown_pairs(self.bodies, self.may_touch)
        return self

    @model_validator(mode="after")
    def _check_consistency(self) -> RobotDescription:
        if len(self.kinematics.rows) != len(self.joints):
            raise ValueError(
                f"kinematics has {len(self.kinematics.rows)} rows for {len(self.joints)} joints;"
                " give one per joint"
            )
        names = self.joint_names
        refuse_same_names(names, "joints")
        if self.spring is not None and self.spring.joint not in names:
            raise ValueError(
                f"spring.joint {self.spring.joint!r} is not a joint; joints are {', '.join(names)}"
            )
        for number, joint in enumerate(self.joints, start=1):
            if joint.rotor is not None and joint.rotor.link > number:
                raise ValueError(
                    f"rotor of joint {joint.name!r} sits on link {joint.rotor.link}; it must sit on"
                    f" the base (0), on a link before its joint, or on its own link {number}"
                )
        return self

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the rated payload relative to the weight of the drawings."""
        masses_kg = sum(link.mass_kg for link in self.cad or ())
        if self.rated_payload_kg is None or not masses_kg:
            return {}
        return {
            "rated_payload_by_arm_mass": (
                self.rated_payload_kg / masses_kg,
                Plausible(1e-3, 5.0, ""),
            )
        }

    def differences(self, other: RobotDescription) -> tuple[str, ...]:
        """Return the keys that show that the other description is of a different robot.

        Limits, friction terms, drawings and bodies may differ: a newer file may describe them
        better.
        """
        of_robot = [key for key in _IDENTITY if getattr(self, key) != getattr(other, key)]
        if len(self.joints) != len(other.joints):
            return (*of_robot, "joints")
        return (*of_robot, *self._differences_of_joints(other))

    def _differences_of_joints(self, other: RobotDescription) -> Iterator[str]:
        """Yield each key that differs at some joint, with the joints."""
        pairs = list(zip(self.joints, other.joints, strict=True))
        for key in _JOINT_IDENTITY:
            here = [n for n, (a, b) in enumerate(pairs) if getattr(a, key) != getattr(b, key)]
            if len(here) == 1:
                yield f"joints.{here[0]}.{key}"
            elif here:
                names = ", ".join(self.joints[n].name for n in here)
                yield f"{key} of {'all joints' if len(here) == len(pairs) else names}"

    @property
    def is_drawn(self) -> bool:
        """True if every link has drawing data that are not a guess."""
        return self.cad is not None and all(link.uncertainty is not None for link in self.cad)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to flange."""
        return tuple(joint.name for joint in self.joints)
