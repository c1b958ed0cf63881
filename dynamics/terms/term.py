"""`Term`: what every part of a robot's model offers, and `NonlinearTerm` for those with more."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol, runtime_checkable

from config.arrays import FloatArray
from dynamics.terms.motion import Motion
from dynamics.terms.term_parameter import NonlinearParameter


class Term(Protocol):
    """A part of the model: names, units, and the columns that belong to them.

    A term gives the regressor, its gradient and the base wrench itself, and so the torque. Two
    backends compute without columns and name the terms that they know: the torque of one sample
    (`dynamics.model.one_sample`) and the exports (`identification.export.model`). Both refuse a
    model with a term that they do not know. To give robots a new effect, write a class like this,
    add it to `RobotModel.from_description` and to those two.
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
    def inertial(self) -> bool:
        """Whether this torque depends on the acceleration: part of the joint-space inertia."""

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
        """Fill in the actuators' torque, link side, per unit parameter.

        Args:
            out: Shape (samples, n, parameters). Zero on entry, a column a parameter.
        """

    @abstractmethod
    def fill_base_wrench(self, motion: Motion, out: FloatArray) -> None:
        """Fill in the base wrench per unit parameter; `out` as (samples, 6, parameters)."""

    @abstractmethod
    def torque_gradient(self, motion: Motion, weights: FloatArray) -> FloatArray:
        """Return how sums of weights * torque columns change with the motion.

        Args:
            weights: Shape (sums, samples, n, parameters). The weights of each sum.

        Returns:
            Shape (sums, 3, samples, n). Derivatives by q, v and a of the joints.
        """


@runtime_checkable
class NonlinearTerm(Protocol):
    """What a term offers besides, where its columns depend on nonlinear parameters."""

    @property
    @abstractmethod
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The nonlinear parameters."""

    @abstractmethod
    def with_nonlinear(self, values: FloatArray) -> Term:
        """Return the same term with other values of the nonlinear parameters."""

    @abstractmethod
    def nonlinear_slopes(self, motion: Motion, coefficients: FloatArray) -> FloatArray:
        """Return how the torque changes with them, shape (samples, n, nonlinear parameters).

        `coefficients` are the values of the term's linear parameters.
        """

    @property
    @abstractmethod
    def changing(self) -> tuple[bool, ...]:
        """Which of the term's columns change with them."""

    @abstractmethod
    def with_changing_only(self) -> Term:
        """Return the same term with no other columns than those."""
