"""`Term`: what every part of a robot's model offers."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol

from config.arrays import FloatArray
from dynamics.terms.motion import Motion


class Term(Protocol):
    """A part of the model: names, units, and the columns that belong to them.

    To give robots a new effect, write a class like this and add it to `RobotModel.terms`. `out` is
    zero on entry and has a column a parameter.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """What the group of parameters is called."""

    @property
    @abstractmethod
    def through_gears(self) -> bool:
        """Whether the gears transmit this torque, so that their efficiency acts on it."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """One name a column, unlike every other term's."""

    @property
    @abstractmethod
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""

    @abstractmethod
    def fill_torque(self, motion: Motion, out: FloatArray) -> None:
        """Fill `out`, (samples, n, parameters): actuator torque, link side, per unit parameter."""

    @abstractmethod
    def fill_base_wrench(self, motion: Motion, out: FloatArray) -> None:
        """Fill `out`, (samples, 6, parameters): base wrench per unit parameter."""

    @abstractmethod
    def torque_gradient(self, motion: Motion, weights: FloatArray) -> FloatArray:
        """Return how sums of weights (sums, samples, n, parameters) * torque columns change.

        The result, (sums, 3, samples, n), holds their derivatives by q, v and a of the joints.
        """
