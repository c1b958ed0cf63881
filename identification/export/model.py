"""`ExportModel`: one value for every standard parameter, in the form for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy.optimize import nnls

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from config.robot.robot import Joint, RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.armature import Armature
from dynamics.terms.friction import Friction
from dynamics.terms.friction_functions import traits
from dynamics.terms.payload import Payload
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK, RigidBodies
from dynamics.terms.rotors import Rotors
from dynamics.terms.spring import Spring
from identification.consistency.closest_robot import ConsistentEstimate
from identification.consistency.consistency_test import ConsistencyTest
from identification.consistency.rigid_body import LinkBody
from identification.elasticity.gear_torque import describe_gear_torque
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate
from identification.friction.curve import friction_columns

T = TypeVar("T")

KNOWN_TERMS = (RigidBodies, Rotors, Armature, Friction, Spring, Payload)
SPEEDS = 200
SLOWEST_SHARE = 0.02


@dataclass(frozen=True)
class StraightFriction:
    """Friction in the form of other formats: friction + damping |speed|, and a constant offset."""

    friction: float
    damping: float
    offset: float


@dataclass(frozen=True, eq=False)
class ExportModel:
    """A robot's model with a value for every standard parameter.

    Attributes:
        model: The model; it contains the speeds of friction and the gear losses.
        parameters: Shape (p,). Values of `model.parameter_names`.
        origin: Lines on the origin of the values.
        warming: Model of the joints' warming, if their friction depends on a temperature that was
            not measured.
        test: The consistency test of physically consistent parameters; None for other parameters.

    Raises:
        EstimationError: The parameters do not fit the model, or the exports do not support a term.
    """

    robot: RobotDescription
    model: RobotModel
    parameters: FloatArray
    origin: tuple[str, ...] = ()
    warming: Warming | None = None
    test: ConsistencyTest | None = None

    def __post_init__(self) -> None:
        shape = (len(self.model.parameter_names),)
        freeze(self, EstimationError, shape, "parameters")
        unknown = [term.name for term in self.model.terms if not isinstance(term, KNOWN_TERMS)]
        if unknown:
            raise EstimationError(
                f"the exports do not support the model's terms {', '.join(unknown)}: leave them"
                " out of the model, or add them to `identification/export`",
                code="RID-MODEL-TERM",
            )

    @classmethod
    def from_estimate(cls, estimate: Estimate) -> ExportModel:
        """Return an estimate's own parameters; they can be physically inconsistent."""
        line = "Parameters as identified; the torques are the same as with the model file."
        origin = _origin(estimate, line)
        values = estimate.standard_values
        return cls(estimate.robot, estimate.model, values, origin, estimate.warming)

    @classmethod
    def from_closest_robot(cls, found: ConsistentEstimate) -> ExportModel:
        """Return the closest physically consistent parameters."""
        estimate = found.estimate
        origin = _origin(estimate, found.sentence)
        values = found.standard_values
        return cls(estimate.robot, estimate.model, values, origin, estimate.warming, found.test)

    @cached_property
    def links(self) -> tuple[LinkBody, ...]:
        """The links about their centres of gravity, base to flange.

        Raises:
            EstimationError: A link has no mass.
        """
        bodies = self.parameters[: PARAMETERS_PER_LINK * self.model.chain.n]
        if np.any(bodies[::PARAMETERS_PER_LINK] == 0.0):
            raise EstimationError(
                "the identified parameters do not contain the links' masses: export the"
                " physically consistent parameters (without --as-identified)",
                code="RID-EXPORT-LINKS",
            )
        return tuple(LinkBody.of(body) for body in bodies.reshape(-1, PARAMETERS_PER_LINK))

    def require_possible_links(self) -> None:
        """Refuse links that are not physically consistent.

        Raises:
            EstimationError: A mass is not positive, or an inertia is impossible.
        """
        for number, link in enumerate(self.links, start=1):
            if not link.is_consistent:
                moments = ", ".join(f"{m:.4g}" for m in link.principal_moments_kg_m2)
                raise EstimationError(
                    f"link {number} is physically impossible: mass {link.mass_kg:.4g} kg,"
                    f" principal moments {moments} kg m^2. A simulator would diverge; export the"
                    " physically consistent parameters, or measure with a motion that moves this"
                    " link",
                    code="RID-EXPORT-LINKS",
                )

    def term(self, kind: type[T]) -> tuple[T, FloatArray] | None:
        """Return a term of the model and its parameters' values; None without this term."""
        groups = self.model.parameter_groups.values()
        for term, columns in zip(self.model.terms, groups, strict=True):
            if isinstance(term, kind):
                return term, self.parameters[columns]
        return None

    def of(self, parameter: str) -> float:
        """Return one parameter's value; 0 if the model does not have it."""
        names = self.model.parameter_names
        return float(self.parameters[names.index(parameter)]) if parameter in names else 0.0

    @cached_property
    def placements(self) -> FloatArray:
        """Pose of every link's frame in the previous one at position zero, (n, 4, 4)."""
        chain = self.model.chain
        out = np.zeros((chain.n, 4, 4))
        for i, (_, _, theta, a, d) in enumerate(chain.rows):
            fixed, (c, s) = chain.fixed_rotations[i], (np.cos(theta), np.sin(theta))
            out[i, :3, :3] = fixed @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            out[i, :3, 3] = d * fixed[:, 2] + np.array([a, 0.0, 0.0])
            out[i, 3, 3] = 1.0
        out[0, :3, 3] += np.array(self.robot.base_offset_m)
        return out

    @property
    def upright(self) -> FloatArray:
        """Rotation of the robot's base in a frame whose z points up, (3, 3)."""
        gravity = self.model.chain.gravity_m_s2
        size = float(np.linalg.norm(gravity))
        if size == 0.0:
            return np.eye(3)
        up = -gravity / size
        return _turn_onto_z(up)

    def is_coupled(self, joint: int) -> bool:
        """Return True if the joint's actuator moves other joints, or others move this joint."""
        if self.model.coupling is None:
            return False
        coupling = self.model.coupling.joints_by_motors
        others = np.delete(np.arange(self.model.chain.n), joint)
        return bool(np.any(coupling[joint, others]) or np.any(coupling[others, joint]))

    def straight_friction(self, joint: int) -> StraightFriction:
        """Return the straight line closest to a joint's friction, without negative coefficients.

        For classical friction the line is exact. Temperatures are the reference temperatures. For a
        joint with coupled actuators, all values are 0.
        """
        found = self.term(Friction)
        if found is None or self.is_coupled(joint):
            return StraightFriction(0.0, 0.0, 0.0)
        fastest = self.robot.joints[joint].limits.velocity
        speed = np.linspace(SLOWEST_SHARE * fastest, fastest, SPEEDS)
        both = np.concatenate([speed, -speed])
        torque = friction_columns(self.model, joint, both) @ found[1]
        forward, backward = np.split(torque, 2)
        line, _ = nnls(np.column_stack([np.ones(SPEEDS), speed]), 0.5 * (forward - backward))
        offset = float(np.mean(0.5 * (forward + backward)))
        return StraightFriction(float(line[0]), float(line[1]), offset)

    def armature(self, joint: int) -> float:
        """Return the contribution of a rotor to its own joint's inertia, link side.

        It is mu^2 I, plus 2 mu e.z I for a motor that is mounted on the link that it moves. This
        equals (1 + mu)^2 I if the lumped part is included (D.27). It is 0 for a joint with coupled
        actuators.
        """
        if self.is_coupled(joint):
            return 0.0
        description = self.robot.joints[joint]
        plain = self.of(f"Ia{joint + 1}")
        inertia, ratio = self.of(f"Im{joint + 1}"), description.gear_ratio
        along = 0.0
        rotor = description.rotor
        if rotor is not None and rotor.link == joint + 1 and description.type == "revolute":
            along = rotor.axis[2]
        return plain + inertia * (ratio**2 + 2.0 * ratio * along)

    def omitted_properties(self, *, armatures: bool) -> tuple[str, ...]:
        """Return descriptions of the properties that simple formats cannot represent.

        Args:
            armatures: The format has armatures and gravity.
        """
        lines: list[str] = []
        for j, joint in enumerate(self.robot.joints):
            lines += self._omitted_of_joint(j, joint, armatures=armatures)
        spring = self.robot.spring
        if spring is not None and (found := self.term(Spring)) is not None:
            term, values = found
            words = ", ".join(
                f"{name} = {value:.6g} {unit}"
                for name, value, unit in zip(
                    term.parameter_names, values, term.parameter_units, strict=True
                )
            )
            lines.append(f"the spring across {spring.joint} ({words})")
        if self.term(Payload) is not None:
            lines.append("the payload: the last link is that of the robot alone")
        gravity = float(np.linalg.norm(self.model.chain.gravity_m_s2))
        if abs(gravity - 9.81) > 1e-6 and not armatures:
            lines.append(f"gravity: the identification used {gravity:.6g} m/s^2")
        return tuple(lines)

    def _omitted_of_joint(self, j: int, joint: Joint, *, armatures: bool) -> list[str]:
        lines: list[str] = []
        if self.is_coupled(j):
            return [f"friction and rotor of {joint.name}: its actuator moves other joints too"]
        inertia = self.of(f"Im{j + 1}")
        if self.armature(j) != 0.0 and not armatures:
            lines.append(
                f"the rotor of {joint.name}: it adds {self.armature(j):.6g} to the joint's inertia"
                " (armature)"
            )
        if inertia != 0.0:
            lines.append(
                f"the effect of the rotor of {joint.name} ({inertia:.6g} kg m^2, ratio"
                f" {joint.gear_ratio:g}) on other joints"
            )
        straight = self.straight_friction(j)
        if abs(straight.offset) > 1e-9 * max(straight.friction, 1e-9):
            lines.append(
                f"the constant part of the friction of {joint.name}: {straight.offset:.6g}"
            )
        found = self.term(Friction)
        columns = () if found is None else found[0].columns
        curved = [word for c in columns if c.joint == j and (word := traits(c.function).words)]
        if curved:
            lines.append(
                f"the curve of the friction of {joint.name} ({', '.join(curved)}): the file has a"
                " straight line"
            )
        if f"fcT_{joint.name}" in self.model.parameter_names:
            lines.append(self._omitted_warming(j, joint))
        lines += [
            f"{loss.parameter.name} = {loss.parameter.value:.6g}: the loss of the gear"
            for loss in self.model.transmission.losses
            if loss.joint == j
        ]
        return lines

    def _omitted_warming(self, j: int, joint: Joint) -> str:
        what = f"the change of the friction of {joint.name}"
        if self.warming is None:
            cold_k = joint.reference_temperature_k
            return f"{what} with its drive's temperature: the file has the friction at {cold_k:g} K"
        constant_s = self.warming.time_constant_s[j]
        return (
            f"{what} as it warms up (time constant {constant_s:.3g} s): the file contains the"
            " friction of a cold robot"
        )


def _origin(estimate: Estimate, sentence: str) -> tuple[str, ...]:
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    runs = ", ".join(estimate.run_ids) or "unnamed runs"
    if estimate.gear_torque_nm is None:
        return f"Identified from {runs}{where}.", sentence
    words = describe_gear_torque(estimate.robot, estimate.gear_torque_nm)
    gears = (
        "The gears are elastic, and this is a model of the links. Torques for the motion of the"
        f" motors differ; in these runs by {words}."
    )
    return f"Identified from {runs}{where}.", sentence, gears


def _turn_onto_z(up: FloatArray) -> FloatArray:
    """Return the smallest rotation R with R up = z; half a turn about x if up is -z."""
    z = np.array([0.0, 0.0, 1.0])
    cosine = float(up @ z)
    if cosine > 1.0 - 1e-15:
        return np.eye(3)
    axis = np.cross(up, z)
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, y, w = axis / size
    skew = np.array([[0.0, -w, y], [w, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + size * skew + (1.0 - cosine) * skew @ skew)
