"""`Parameter`: an identified value with its 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

from rid_daq.blocks.formats import format_measured


@dataclass(frozen=True)
class Parameter:
    """A base parameter, friction parameter or quantity of a payload, with its 95 % interval.

    Attributes:
        name: Name of the quantity, or of the first standard parameter of a combination.
        expression: The combination of standard parameters; the name if there is no combination.
        unit: Unit of the value.
        value, sigma: The estimate, and its standard deviation, which includes model error.
        is_shown: False if the recordings do not determine the value: its interval is meaningless.
    """

    name: str
    expression: str
    unit: str
    value: float
    sigma: float
    is_shown: bool = True

    @property
    def interval(self) -> tuple[float, float]:
        """The ends of the 95 % interval: two standard deviations to either side."""
        return self.value - 2.0 * self.sigma, self.value + 2.0 * self.sigma

    def __str__(self) -> str:
        """Return one line: the combination, its estimate, and half of its 95 % interval.

        If the recordings do not determine the combination, the line says so instead of the values.
        """
        value, reach = format_measured(self.value, 2.0 * self.sigma)
        shown = f"{value} ± {reach} {self.unit}" if self.is_shown else "not determined"
        return f"{self.expression} = {shown}"
