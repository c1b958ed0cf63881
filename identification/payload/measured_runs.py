"""`MeasuredRuns`: runs with and without a payload, periodic or smoothed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.payload.equations import PayloadEquations, PayloadModel, Procedure


@dataclass(frozen=True, eq=False)
class MeasuredRuns(ABC):
    """Runs with and without a payload, in the form of `PeriodicRuns` or `SmoothedRuns`.

    Attributes:
        sources: Data of each run.
        loaded: For each run, True if it carried the payload.
    """

    sources: tuple[PeriodAverage | SmoothedSignals, ...]
    loaded: tuple[bool, ...]

    def __post_init__(self) -> None:
        if len(self.loaded) != len(self.sources):
            raise EstimationError(
                f"loaded has {len(self.loaded)} values, but there are {len(self.sources)} runs:"
                " give one value for each run",
                code="RID-API-ARGUMENT",
            )

    @property
    def torque_nm(self) -> FloatArray:
        """RMS of each joint's torque in all runs, shape (n,) [N m or N]."""
        torque = np.vstack([source.torque_nm for source in self.sources])
        return np.asarray(np.sqrt(np.mean(torque**2, axis=0)))

    def part(self, chosen: Sequence[int], *, carrying: bool = False) -> Self:
        """Return some of the runs, by index; with `carrying`, all count as loaded."""
        return replace(
            self,
            sources=tuple(self.sources[i] for i in chosen),
            loaded=tuple(carrying or self.loaded[i] for i in chosen),
        )

    def pair(self) -> tuple[int, int]:
        """Return the indices of the run with the payload and of the run without it.

        Raises:
            EstimationError: There are not exactly these two runs.
        """
        if sorted(self.loaded) != [False, True]:
            raise EstimationError(
                "the procedure `difference` needs exactly one run with the payload and one"
                " without: give two runs, or use the procedure `together`",
                code="RID-PAYLOAD-PROCEDURE",
            )
        return self.loaded.index(True), self.loaded.index(False)

    @abstractmethod
    def equations(
        self,
        model: PayloadModel,
        procedure: Procedure,
        *,
        robot: Estimate | None = None,
        standard: FloatArray | None = None,
    ) -> PayloadEquations:
        """Set up the equations of the payload and of all other unknowns.

        Args:
            model: The robot with the unknown body.
            procedure: Procedure that separates the payload from the robot.
            robot: The robot without payload, for `model`.
            standard: Shape (p,). Point at which nonlinear parameters are linearised; see
                `torque_columns`.

        Raises:
            EstimationError: The runs do not fit the procedure.
        """

    @abstractmethod
    def estimate(
        self, robot: RobotDescription, model: ModelOptions, payload: Sequence[bool]
    ) -> Estimate:
        """Estimate a whole robot; `payload` marks the runs that carry an unknown body.

        Raises:
            EstimationError: The motion does not determine the parameters.
        """
