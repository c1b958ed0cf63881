"""`Term`: interface of the parts of a robot's model; `NonlinearTerm`: additions for some terms."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol, runtime_checkable

from config.arrays import FloatArray
from dynamics.terms.motion import TermMotion
from dynamics.terms.term_parameter import NonlinearParameter


class Term(Protocol):
    """A part of the model: parameters with names and units, and their columns in the regressor.

    A term computes its columns of the regressor and of the base wrench's regressor, and the
    gradient of its columns; the torque follows from the columns. Two modules do not use the
    columns: `dynamics.model.one_sample`, which computes the torque of one sample, and
    `identification.export.model`, which exports a model. They list the terms that they support, and
    refuse a model with any other term. To add an effect, write a class with the members of `Term`,
    and add it to `RobotModel.from_description` and to these two modules.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the term, which is also that of its group of parameters."""

    @property
    @abstractmethod
    def through_gears(self) -> bool:
        """True if the gears transmit the term's torque, so that gear losses depend on it."""

    @property
    @abstractmethod
    def inertial(self) -> bool:
        """True if the torque depends on acceleration, so that the inertia matrix contains it."""

    @property
    @abstractmethod
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, one per column, different from those of all other terms."""

    @property
    @abstractmethod
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""

    @abstractmethod
    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the actuators' torques, link side, per unit of each parameter.

        Args:
            out: Shape (samples, n, parameters). One column per parameter. Zero on entry, except for
                `RigidBodies`, which writes every element.
        """

    @abstractmethod
    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the base wrench per unit parameter into `out`, (samples, 6, parameters)."""

    @abstractmethod
    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of the torque columns with respect to the motion.

        Args:
            weights: Shape (sums, samples, n, parameters). Weights of the elements of the torque
                columns, for each sum.

        Returns:
            Shape (sums, 3, samples, n). Derivatives with respect to q, v and a of the joints.
        """


@runtime_checkable
class NonlinearTerm(Protocol):
    """Additional interface of a term whose columns depend on nonlinear parameters."""

    @property
    @abstractmethod
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The nonlinear parameters of the term."""

    @abstractmethod
    def with_nonlinear(self, values: FloatArray) -> Term:
        """Return a copy with other values of the nonlinear parameters."""

    @abstractmethod
    def nonlinear_slopes(self, motion: TermMotion, coefficients: FloatArray) -> FloatArray:
        """Return the derivatives of the torque with respect to the nonlinear parameters.

        The shape is (samples, n, nonlinear parameters). `coefficients` are the values of the
        term's linear parameters, one per column.
        """

    @property
    @abstractmethod
    def changing(self) -> tuple[bool, ...]:
        """For each column of the term, True if it depends on the nonlinear parameters."""

    @abstractmethod
    def with_changing_only(self) -> Term:
        """Return a copy with only those columns that depend on the nonlinear parameters."""
