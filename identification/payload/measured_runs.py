"""`MeasuredRuns`: runs with and without a payload, whatever they were made into."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Protocol, Self

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.payload.equations import PayloadEquations, PayloadModel, Procedure


class MeasuredRuns(Protocol):
    """What the procedures ask of runs: `PeriodicRuns` and `SmoothedRuns` answer."""

    @property
    @abstractmethod
    def loaded(self) -> tuple[bool, ...]:
        """Which runs carried the payload."""

    @property
    @abstractmethod
    def torque_nm(self) -> FloatArray:
        """RMS of each joint's torque in all runs, shape (n,) [N m or N]."""

    @abstractmethod
    def part(self, chosen: Sequence[int], *, carrying: bool = False) -> Self:
        """Return some of the runs, by number from 0; `carrying`, as if all carried something."""

    @abstractmethod
    def equations(
        self,
        model: PayloadModel,
        procedure: Procedure,
        *,
        robot: Estimate | None = None,
        standard: FloatArray | None = None,
    ) -> PayloadEquations:
        """Set up the equations of the payload and of all else.

        Args:
            model: The robot with the unknown body.
            procedure: How the robot is told from the payload.
            robot: The robot without payload, for `model`.
            standard: Shape (p,). Where nonlinear parameters are linearised; see `torque_columns`.

        Raises:
            EstimationError: The runs do not fit the procedure.
        """

    @abstractmethod
    def estimate(
        self, robot: RobotDescription, model: ModelOptions, payload: Sequence[bool]
    ) -> Estimate:
        """Estimate a whole robot; `payload` says which runs carry an unknown body of their own.

        Raises:
            EstimationError: The motion does not show the parameters.
        """
