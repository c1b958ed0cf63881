"""`Term`: interface of all parts of a robot's model; `NonlinearTerm`: with nonlinear parameters."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol, runtime_checkable

from config.arrays import FloatArray
from dynamics.terms.motion import TermMotion
from dynamics.terms.term_parameter import NonlinearParameter


class Term(Protocol):
    """A part of the model: names, units, and the columns that belong to them.

    A term computes its part of the regressor, of the regressor's gradient, of the base wrench, and
    thereby of the torque. Two other modules compute without columns: the torque of one sample
    (`dynamics.model.one_sample`) and the exports (`identification.export.model`). They list the
    terms that they support, and refuse a model with any other term. To add an effect, write a class
    like this one, and add it to `RobotModel.from_description` and to those two modules.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the group of parameters."""

    @property
    @abstractmethod
    def through_gears(self) -> bool:
        """True if the gears transmit this torque, so that their losses act on it."""

    @property
    @abstractmethod
    def inertial(self) -> bool:
        """True if this torque depends on the acceleration: part of the joint-space inertia."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """One name per column, different from those of all other terms."""

    @property
    @abstractmethod
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""

    @abstractmethod
    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Fill in the actuators' torque, link side, per unit parameter.

        Args:
            out: Shape (samples, n, parameters). Zero on entry, one column per parameter.
        """

    @abstractmethod
    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Fill in the base wrench per unit parameter; `out` as (samples, 6, parameters)."""

    @abstractmethod
    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of sums of weights * torque columns by the motion.

        Args:
            weights: Shape (sums, samples, n, parameters). The weights of each sum.

        Returns:
            Shape (sums, 3, samples, n). Derivatives by q, v and a of the joints.
        """


@runtime_checkable
class NonlinearTerm(Protocol):
    """Additional interface of a term whose columns depend on nonlinear parameters."""

    @property
    @abstractmethod
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The nonlinear parameters."""

    @abstractmethod
    def with_nonlinear(self, values: FloatArray) -> Term:
        """Return the term with other values of the nonlinear parameters."""

    @abstractmethod
    def nonlinear_slopes(self, motion: TermMotion, coefficients: FloatArray) -> FloatArray:
        """Return the torque's derivative by them, shape (samples, n, nonlinear parameters).

        `coefficients` are the values of the term's linear parameters.
        """

    @property
    @abstractmethod
    def changing(self) -> tuple[bool, ...]:
        """For each column of the term: True if it depends on the nonlinear parameters."""

    @abstractmethod
    def with_changing_only(self) -> Term:
        """Return the term with only the columns that depend on the nonlinear parameters."""
