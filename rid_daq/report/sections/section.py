"""`Section`: what all parts of a result have in common, and how numbers are kept in them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Protocol

from pydantic import SerializerFunctionWrapHandler, Strict, model_serializer

from config.model import ConfigModel
from config.robot.robot import Joint
from identification.regression.fit_grade import Grade

Numbers = Annotated[tuple[float, ...], Strict(False)]
"""A row of numbers, such as a curve."""

Texts = Annotated[tuple[str, ...], Strict(False)]
"""A row of names or sentences."""

CURVE_POINTS = 1500


class Section(ConfigModel):
    """A frozen part of a result.

    A field without a default is always written, as null where there is nothing; a field whose
    default is null is left out of the file where there is nothing.
    """

    @model_serializer(mode="wrap")
    def _without_absent(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        fields = type(self).model_fields
        return {
            key: value
            for key, value in handler(self).items()
            if value is not None or key not in fields or fields[key].is_required()
        }


def units(joint: Joint) -> tuple[str, str]:
    """Return the units of a joint's position and of its torque."""
    return ("rad", "N m") if joint.type == "revolute" else ("m", "N")


class GradedAxis(Protocol):
    """An axis whose fit is graded."""

    @property
    def joint(self) -> str:
        """Its name."""
        ...

    @property
    def grade(self) -> Grade | None:
        """How far its fit can be trusted; None where that was not judged."""
        ...

    @property
    def reason(self) -> str | None:
        """What decides the grade."""
        ...


def curve_rows(rows: int) -> slice:
    """Return which of so many rows a curve of the report shows."""
    return slice(0, rows, max(1, -(-rows // CURVE_POINTS)))


def rounded(values: Iterable[float], digits: int = 5) -> tuple[float, ...]:
    """Return values for a drawing: so many significant digits."""
    return tuple(float(f"{value:.{digits}g}") for value in values)


def finite(value: float) -> float | None:
    """Return a number, None where it is not finite."""
    return float(value) if math.isfinite(value) else None
