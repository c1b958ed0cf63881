"""`read_arrays`: reads the arrays in a MAT, NPZ, HDF5 or Parquet file, each with its name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, TypeGuard

import numpy as np
import numpy.typing as npt

from config.errors import ConfigError, RidDaqError, missing_library, system_errors
from config.formats.bounded_file import open_file

ARRAY_ENDINGS: Final = (".mat", ".npz", ".h5", ".hdf5", ".parquet")

Array = npt.NDArray[Any]
LARGEST_FILE_BYTES: Final = 500_000_000
"""Largest size of a file; such files are read as a whole."""
_HDF5_MARK = b"\x89HDF\r\n\x1a\n"
_NUMBERS = "biuf"


def is_array_file(path: Path) -> bool:
    """Return True if a path has the extension of a file of arrays."""
    return path.suffix.lower() in ARRAY_ENDINGS


def read_arrays(path: Path) -> dict[str, Array]:
    """Return the arrays of numbers, dates or text in a file.

    - A field of a MATLAB structure, of a NumPy record or of a Parquet structure is named
      `structure.field`; element k of a MATLAB structure array or cell array `name(k)`, counted
      from 1.
    - A dataset of an HDF5 file is named by its path, `group/dataset`.
    - Dates become whole nanoseconds since 1970, and durations whole nanoseconds. A date, duration
      or integer that is missing becomes an empty text, as in a CSV file.
    - Other contents are left out: objects such as Python objects, which `unread_names` names, texts
      of HDF5 files, and Parquet lists of varying length.

    Raises:
        ConfigError: The file cannot be read, is too large, or the library that reads it is not
            installed.
    """
    return {name: array for name, array in _contents(path) if array is not None}


def unread_names(path: Path) -> tuple[str, ...]:
    """Return the names of the objects that `read_arrays` leaves out, such as Python objects."""
    return tuple(name for name, array in _contents(path) if array is None)


def _contents(path: Path) -> list[tuple[str, Array | None]]:
    """Return the contents of a file with their names; None for objects, which cannot be read."""
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, LARGEST_FILE_BYTES) as file,
    ):
        is_hdf5 = _HDF5_MARK in file.read(520)  # MATLAB 7.3 writes 512 bytes before this signature
    readers: dict[str, Callable[[Path], Mapping[str, object]]] = {
        ".mat": _read_matlab_hdf5 if is_hdf5 else _read_matlab,
        ".npz": _read_npz,
        ".parquet": _read_parquet,
    }
    reader = readers.get(path.suffix.lower(), _read_hdf5)
    try:
        contents = reader(path)
    except (RidDaqError, MemoryError):
        raise
    except Exception as error:  # for a damaged file, the libraries raise exceptions of many types
        raise ConfigError(
            f"{path}: cannot be read as a {path.suffix.lower()} file:"
            f" {type(error).__name__}: {error}",
            code="RID-FILE-TYPE",
        ) from error
    return list(_flatten(contents, ""))


def _flatten(contents: Mapping[str, object], prefix: str) -> Iterator[tuple[str, Array | None]]:
    for key, value in contents.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{name}.")
            continue
        if _is_list_of_contents(value):
            yield from _flatten({f"{name}({n})": each for n, each in enumerate(value, 1)}, "")
            continue
        array = np.asarray(value)
        if array.dtype.names is not None:
            yield from _flatten({field: array[field] for field in array.dtype.names}, f"{name}.")
        elif array.dtype.kind in "Mm":
            whole = array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64)
            missing = np.isnat(array)
            yield name, np.where(missing, "", whole.astype(np.str_)) if missing.any() else whole
        else:
            yield name, array if array.dtype.kind in _NUMBERS + "U" else None


def _is_list_of_contents(value: object) -> TypeGuard[Iterable[object]]:
    """Return True for a structure array or cell array as `loadmat` returns it."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "O" or value.ndim != 1:
            return False
        value = value.tolist()
    return isinstance(value, list) and any(isinstance(x, (Mapping, np.ndarray)) for x in value)


def _read_npz(path: Path) -> dict[str, object]:
    arrays: dict[str, object] = {}
    with np.load(path, allow_pickle=False) as file:
        for name in file.files:
            try:
                arrays[name] = file[name]
            except ValueError as error:  # an array of Python objects can contain code
                if "pickle" not in str(error):
                    raise
                arrays[name] = None
    return arrays


def _read_matlab(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    contents: dict[str, Any] = loadmat(path, simplify_cells=True)
    return {name: value for name, value in contents.items() if not name.startswith("__")}


def _read_matlab_hdf5(path: Path) -> dict[str, Array]:
    """Return the arrays of a MAT file of version 7.3, with the names of older versions."""
    arrays = _read_hdf5(path)
    return {
        name.replace("/", "."): array for name, array in arrays.items() if not name.startswith("#")
    }


def _read_hdf5(path: Path) -> dict[str, Array]:
    try:
        import h5py
    except ImportError:
        raise missing_library(f"{path}: HDF5", "hdf5") from None
    arrays: dict[str, Array] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in _NUMBERS + "V":
            arrays[name] = item[()]

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return arrays


def _read_parquet(path: Path) -> dict[str, Array]:
    from pyarrow import parquet, types

    table = parquet.read_table(path)
    while any(types.is_struct(field.type) for field in table.schema):
        table = table.flatten()
    arrays: dict[str, Array] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if types.is_list(column.type) or types.is_fixed_size_list(column.type):
            rows = column.to_pylist()
            lengths = {len(row) for row in rows if row is not None}
            if len(lengths) == 1:
                missing = [np.nan] * lengths.pop()
                arrays[name] = np.array([row or missing for row in rows], dtype=np.float64)
        elif types.is_string(column.type) or types.is_large_string(column.type):
            arrays[name] = np.array([text or "" for text in column.to_pylist()], dtype=np.str_)
        elif types.is_decimal(column.type):
            arrays[name] = column.cast("float64").to_numpy()
        elif types.is_integer(column.type) and column.null_count:
            texts = ["" if value is None else str(value) for value in column.to_pylist()]
            arrays[name] = np.array(texts, dtype=np.str_)
        else:
            arrays[name] = column.to_numpy()
    return arrays
