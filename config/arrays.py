"""Checked, read-only arrays for the frozen dataclasses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from config.errors import RidDaqError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
PhaseArray = NDArray[np.uint8]


def read_only(
    name: str,
    values: Any,
    dtype: DTypeLike,
    shape: tuple[int | None, ...],
    error: type[RidDaqError],
) -> NDArray[Any]:
    """Return `values` as a read-only array after checking its shape and that it is finite.

    The values are copied unless their memory is already read-only.

    Args:
        name: Name of the array in a message.
        shape: Required shape; None for an axis of any length.
        error: Class of the error raised.

    Raises:
        RidDaqError: The shape is wrong, or a value is not finite; the error has the class `error`.
    """
    array = np.array(values, dtype=dtype, order="C", copy=None if _is_frozen(values) else True)
    if len(array.shape) != len(shape) or any(
        wanted is not None and wanted != found
        for wanted, found in zip(shape, array.shape, strict=True)
    ):
        words = ", ".join("any" if length is None else str(length) for length in shape)
        raise error(
            f"{name} must have shape ({words}), it has {array.shape}", code="RID-API-ARGUMENT"
        )
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise error(f"{name} is not finite at index {where}", code="RID-API-ARGUMENT")
    array.setflags(write=False)
    return array


def freeze(
    owner: object,
    error: type[RidDaqError],
    shape: tuple[int | None, ...],
    *names: str,
    what: str = "",
    dtype: DTypeLike = float,
) -> None:
    """Replace fields of a frozen dataclass by `read_only` arrays; a field that is None stays None.

    Args:
        owner: The dataclass, in its `__post_init__`.
        error, shape, dtype: As for `read_only`.
        *names: Names of the fields.
        what: Prefix of a field's name in a message.

    Raises:
        RidDaqError: As `read_only`.
    """
    for name in names:
        if (values := getattr(owner, name)) is not None:
            array = read_only(f"{what}{name}", values, dtype, shape, error)
            object.__setattr__(owner, name, array)


def _is_frozen(values: Any) -> bool:
    """Return True if an array and the numpy memory that it views are read-only."""
    while isinstance(values, np.ndarray) and not values.flags.writeable:
        if values.base is None:
            return True
        values = values.base
    return False
