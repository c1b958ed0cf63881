"""Checked, read-only arrays for the frozen dataclasses.

An array can be the mapping of a file (`config.column_file`). The pages of the file that a
computation touches then occupy memory until `release` returns them to the system.
"""

from __future__ import annotations

import mmap
from typing import Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

from config.errors import RidDaqError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
PhaseArray = NDArray[np.uint8]

PIECE_ROWS: Final = 65_536
"""Number of rows of a long array that are processed at a time, to limit the memory."""


def release(*arrays: NDArray[Any]) -> None:
    """Return the memory of mapped files to the system; their values stay in the file."""
    for array in arrays:
        memory = _memory(array)
        if isinstance(memory, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
            memory.madvise(mmap.MADV_DONTNEED)


def is_mapped(array: NDArray[Any]) -> bool:
    """Return True if an array is the mapping of a file."""
    return isinstance(_memory(array), mmap.mmap)


def _memory(array: NDArray[Any]) -> Any:
    """Return the object that owns an array's memory; None if numpy owns it."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    return base


def lock(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array after making it, and the memory that it views, read-only."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base.setflags(write=False)
        base = base.base
    return array


def read_only(
    name: str,
    values: Any,
    dtype: DTypeLike,
    shape: tuple[int | None, ...],
    error: type[RidDaqError],
) -> NDArray[Any]:
    """Return `values` as a read-only array after checking its shape and that it is finite.

    The values are copied in C order unless their memory is already read-only.

    Args:
        name: Name of the array in a message.
        shape: Required shape; None for an axis of any length.
        error: Class of the error raised.

    Raises:
        RidDaqError: The shape is wrong, or a value is not finite; the error has the class `error`.
    """
    if _is_frozen(values):
        array = np.asarray(values, dtype=dtype)
    else:
        array = np.array(values, dtype=dtype, order="C")
    if len(array.shape) != len(shape) or any(
        wanted is not None and wanted != found
        for wanted, found in zip(shape, array.shape, strict=True)
    ):
        words = ", ".join("any" if length is None else str(length) for length in shape)
        raise error(
            f"{name} must have shape ({words}), it has {array.shape}", code="RID-API-ARGUMENT"
        )
    if array.dtype.kind == "f" and not _all_finite(array):
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


def _all_finite(array: NDArray[Any]) -> bool:
    for first in range(0, len(array), PIECE_ROWS):
        if not np.isfinite(array[first : first + PIECE_ROWS]).all():
            return False
        release(array)
    return True


def _is_frozen(values: Any) -> bool:
    """Return True if an array and the numpy memory or mapped file that it views are read-only."""
    while isinstance(values, np.ndarray) and not values.flags.writeable:
        base: Any = values.base
        if base is None or isinstance(base, mmap.mmap):
            return True
        values = base
    return False
