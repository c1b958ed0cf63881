"""`Section`: base class of all parts of a result, and the number formats in them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Protocol

from pydantic import SerializerFunctionWrapHandler, Strict, model_serializer

from config.model import ConfigModel
from identification.regression.fit_grade import Grade

Numbers = Annotated[tuple[float, ...], Strict(False)]
"""A row of numbers, such as a curve."""

Texts = Annotated[tuple[str, ...], Strict(False)]
"""A row of names or sentences."""

CURVE_POINTS = 1500


class Section(ConfigModel):
    """A frozen part of a result.

    A field without a default is always written; it is null if there is no value. A field whose
    default is null is left out of the file if there is no value.
    """

    @model_serializer(mode="wrap")
    def _without_absent(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        fields = type(self).model_fields
        return {
            key: value
            for key, value in handler(self).items()
            if value is not None or key not in fields or fields[key].is_required()
        }


class GradedAxis(Protocol):
    """An axis whose fit is graded."""

    @property
    def joint(self) -> str:
        """The joint's name."""
        ...

    @property
    def grade(self) -> Grade | None:
        """Grade of the axis's fit; None if the fit was not graded."""
        ...

    @property
    def reason(self) -> str | None:
        """The reason for the grade."""
        ...


def thinning_slice(rows: int) -> slice:
    """Return the slice that thins a number of rows to at most `CURVE_POINTS`, for a drawing."""
    return slice(0, rows, max(1, -(-rows // CURVE_POINTS)))


def round_values(values: Iterable[float], digits: int = 5) -> tuple[float, ...]:
    """Return the values, rounded to `digits` significant digits for a drawing."""
    return tuple(float(f"{value:.{digits}g}") for value in values)


def finite_or_none(value: float) -> float | None:
    """Return the number; None if it is not finite."""
    return float(value) if math.isfinite(value) else None
