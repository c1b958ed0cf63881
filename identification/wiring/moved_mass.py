"""`MovedMass`: comparison of the force of a prismatic joint with the mass that the joint moves.

If gravity loads a prismatic joint equally in every pose, no fit separates this load from a friction
offset. The force that accelerates the joint shows the moving mass, rotor included. Therefore the
force that holds the joint is compared with the weight of this mass: it must be positive, and at
most `LARGEST_HELD` times this weight. A joint also moves the links of all later joints. Therefore
its mass is compared with theirs and, with `cad`, with the drawn one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor
from identification.model.drawn_arm import drawn_parameters, plausible_weight
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import EXPLAINED_SHARE, CondensedEquations, plain_model
from identification.wiring.weight import OFFSET_SHARE, constant_weight, is_counterbalanced

EVERY: Final = 8
LARGEST_HELD: Final = 1.2
"""Largest plausible ratio of the holding force to the weight of the moving mass."""
LOWEST_FRICTION: Final = 0.2
"""A weight is judged without `cad` if Coulomb friction is below this fraction of the weight of the
moving mass; otherwise friction hides it."""
WIDEST_HELD: Final = 0.1
"""Half the widest interval of the ratio that shows a missing weight; slow motion widens it."""
LEAST_SLOPE_M_S2: Final = 0.1
FORCE_ERRORS: Final = 1.25
"""Largest plausible ratio of the force constants of two joints to the stated ratio."""


@dataclass(frozen=True)
class CarriedMass:
    """Mass of the links that a later prismatic joint moves, without the inertia of its rotor.

    Attributes:
        joint: Name of the later joint.
        mass_kg, sigma_kg: The mass and its standard deviation.
    """

    joint: str
    mass_kg: float
    sigma_kg: float


@dataclass(frozen=True)
class MovedMass:
    """Moving mass and holding force of a prismatic joint.

    Attributes:
        joint: Name of the joint.
        mass_kg, sigma_kg: Mass that the joint's force accelerates: that of the links and, divided
            by the square of the gear ratio, the inertia of the rotor; and its standard deviation.
        held: Force that holds the joint against gravity, relative to the weight of `mass_kg`; None
            if gravity does not load the joint, or if a counterbalance carries the weight.
        held_sigma: Standard deviation of `held`, with that of a friction offset.
        drawn: `mass_kg` relative to the mass of the links in `cad`; None without `cad`.
        drawn_sigma: Standard deviation of `drawn`.
        plausible: Smallest and largest plausible value of `drawn`.
        hidden: True if friction is too large to judge a small `held`.
        has_rotor: True if `mass_kg` contains the inertia of a rotor.
        carried: Largest mass of the links that a later joint moves; None if it is not known.
    """

    joint: str
    mass_kg: float
    sigma_kg: float
    held: float | None
    held_sigma: float | None
    drawn: float | None
    drawn_sigma: float | None
    plausible: tuple[float, float]
    hidden: bool
    has_rotor: bool
    carried: CarriedMass | None = None

    @property
    def links(self) -> CarriedMass | None:
        """Mass of the links alone; None if it is not known."""
        if self.held is not None and self.held_sigma is not None:
            return CarriedMass(self.joint, self.held * self.mass_kg, self.held_sigma * self.mass_kg)
        if self.has_rotor:
            return None
        return CarriedMass(self.joint, self.mass_kg, self.sigma_kg)

    @property
    def is_plausible(self) -> bool:
        """True if neither the weight nor the mass is impossible."""
        return not self.sentence

    @property
    def is_light(self) -> bool:
        """True if the mass is smaller than that of the links in `cad` can be."""
        if self.drawn is None or self.drawn_sigma is None:
            return False
        return self.drawn + 2.0 * self.drawn_sigma < self.plausible[0]

    @property
    def is_weightless(self) -> bool:
        """True if the holding force does not differ from zero, although the weight is visible."""
        if self.held is None or self.held_sigma is None or self.hidden:
            return False
        return abs(self.held) <= 2.0 * self.held_sigma < WIDEST_HELD

    @property
    def sentence(self) -> str:
        """The contradiction as a sentence without a full stop; empty if there is none."""
        mass = f"the mass that the force of {self.joint} accelerates ({self.mass_kg:.3g} kg)"
        if self.held is not None and self.held_sigma is not None:
            reach = 2.0 * self.held_sigma
            value = f"{self.held:.2g} ± {reach:.2g} times the weight of {mass}"
            if self.is_weightless:
                return (
                    f"the force that holds {self.joint} is {value}, so it contains no weight: look"
                    " for forces without gravity; if a cylinder or counterweight carries the"
                    " weight, write `counterbalanced: true` for the joint in the robot file"
                )
            if self.held + reach < 0.0:
                return (
                    f"the force that holds {self.joint} is {value}: look for a reversed direction"
                    " of the joint or of gravity; if a cylinder or counterweight carries the"
                    " weight, write `counterbalanced: true` for the joint in the robot file"
                )
            if self.held - reach > LARGEST_HELD:
                return (
                    f"the force that holds {self.joint} is {value}: look for a wrong unit of its"
                    " position, a wrong gear ratio or a wrong clock"
                )
        if self.drawn is not None and self.drawn_sigma is not None:
            reach = 2.0 * self.drawn_sigma
            if self.is_light or self.drawn - reach > self.plausible[1]:
                return (
                    f"{mass} is {self.drawn:.2g} ± {reach:.2g} times the mass in `cad`: look for a"
                    " wrong unit or constant of its force, a wrong unit of its position, or wrong"
                    " masses in `cad`"
                )
        if self.carried is not None:
            least_kg = (self.carried.mass_kg - 2.0 * self.carried.sigma_kg) / FORCE_ERRORS
            if self.mass_kg + 2.0 * self.sigma_kg < least_kg:
                return (
                    f"{mass} is smaller than that of the links that {self.carried.joint} moves"
                    f" ({self.carried.mass_kg:.3g} kg), although {self.joint} moves these links"
                    " too: look for a wrong unit or constant of one of these forces, or a wrong"
                    " unit of one of these positions; if the motors have rotors, write `armature:"
                    " true` for the joints in the robot file"
                )
        return ""


def moved_masses(signals: WiredSignals) -> tuple[MovedMass, ...]:
    """Return the moving mass of each prismatic joint that moves and whose force is explained.

    Args:
        signals: The signals and the robot as stated in the files.
    """
    robot = signals.robot
    moving = np.flatnonzero(signals.moving).tolist()
    joints = [j for j in moving if robot.joints[j].type == "prismatic"]
    if not joints or robot.coupling is not None:
        return ()
    equations = CondensedEquations.of(signals)
    shares = equations.held_out(np.eye(len(robot.joints))).residual_share
    explained = [j for j in joints if shares[j] < EXPLAINED_SHARE]
    found = list(_moved_masses(signals, plain_model(signals), equations, explained))
    links = [each.links for each in found]
    return tuple(
        replace(
            each,
            carried=max(
                (own for own in links[number + 1 :] if own is not None),
                key=lambda own: own.mass_kg,
                default=None,
            ),
        )
        for number, each in enumerate(found)
    )


def _moved_masses(
    signals: WiredSignals, model: RobotModel, equations: CondensedEquations, joints: list[int]
) -> Iterator[MovedMass]:
    robot, n = signals.robot, len(signals.robot.joints)
    values, parts = equations.fits(np.eye(n))
    drawn_values = drawn_parameters(model, robot)
    own = model.parameter_groups["rigid_body"]
    q = signals.joints()[0][::EVERY]
    rest = regressor(model, q, np.zeros_like(q), np.zeros_like(q))
    low, high = plausible_weight(robot)
    for j in joints:
        forward = np.zeros_like(q)
        forward[:, j] = 1.0
        inertia = (regressor(model, q, np.zeros_like(q), forward) - rest)[:, j].mean(axis=0)
        mass_kg = float(inertia @ values)
        sigma_kg = equations.scatter(inertia @ parts.T)
        slope = rest[:, j, model.parameter_names.index(f"m{j + 1}")]  # force per mass [N/kg]
        friction = abs(float(values[model.parameter_names.index(f"fc_{robot.joints[j].name}")]))
        weight = float(slope.mean()) * mass_kg
        held = held_sigma = drawn = drawn_sigma = None
        if (
            mass_kg > 0.0
            and abs(slope.mean()) > LEAST_SLOPE_M_S2
            and constant_weight(slope)
            and not is_counterbalanced(robot, j)
        ):
            hold = rest[:, j].mean(axis=0)
            held = float(hold @ values) / weight
            noise = equations.scatter((hold @ parts.T) / (slope.mean() * (inertia @ parts.T)))
            held_sigma = float(np.hypot(noise, 0.5 * OFFSET_SHARE * friction / abs(weight)))
        if robot.is_drawn and (links := float(inertia[own] @ drawn_values[own])) > 0.0:
            drawn, drawn_sigma = mass_kg / links, sigma_kg / links
        yield MovedMass(
            joint=robot.joints[j].name,
            mass_kg=mass_kg,
            sigma_kg=sigma_kg,
            held=held,
            held_sigma=held_sigma,
            drawn=drawn,
            drawn_sigma=drawn_sigma,
            plausible=(low, float("inf") if _has_rotor(robot, j) else high),
            hidden=friction > LOWEST_FRICTION * abs(weight),
            has_rotor=_has_rotor(robot, j),
        )


def _has_rotor(robot: RobotDescription, j: int) -> bool:
    """Return True if the robot file states that the joint's motor has a rotor."""
    return robot.joints[j].rotor is not None or robot.joints[j].armature
