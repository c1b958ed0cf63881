"""`read_arrays`: reads the arrays in a MAT, NPZ, HDF5 or Parquet file, each with its name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from acquisition.imports.lines import LARGEST_FILE_BYTES
from config.errors import ConfigError, RidDaqError, missing_library, system_errors
from config.formats.bounded_file import open_file

ARRAY_ENDINGS: Final = (".mat", ".npz", ".h5", ".hdf5", ".parquet")

Array = npt.NDArray[Any]
_HDF5_MARK = b"\x89HDF\r\n\x1a\n"
_NUMBERS = "biuf"


def is_array_file(path: Path) -> bool:
    """Return True if a path has the extension of a file of arrays."""
    return path.suffix.lower() in ARRAY_ENDINGS


def read_arrays(path: Path) -> dict[str, Array]:
    """Return the arrays of numbers, dates or text in a file.

    - A field of a MATLAB structure, of a NumPy record or of a Parquet structure is named
      `structure.field`.
    - A dataset of an HDF5 file is named by its path, `group/dataset`.
    - Dates become whole nanoseconds since 1970.
    - Other contents, such as objects and cell arrays, are left out.

    Raises:
        ConfigError: The file cannot be read, is too large, or the library that reads it is not
            installed.
    """
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
    return dict(_flatten(contents, ""))


def _flatten(contents: Mapping[str, object], prefix: str) -> Iterator[tuple[str, Array]]:
    for key, value in contents.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{name}.")
            continue
        array = np.asarray(value)
        if array.dtype.names is not None:
            yield from _flatten({field: array[field] for field in array.dtype.names}, f"{name}.")
        elif array.dtype.kind == "M":
            yield name, array.astype("datetime64[ns]").astype(np.int64)
        elif array.dtype.kind in _NUMBERS + "U":
            yield name, array


def _read_npz(path: Path) -> dict[str, Array]:
    arrays: dict[str, Array] = {}
    with np.load(path, allow_pickle=False) as file:
        for name in file.files:
            try:
                arrays[name] = file[name]
            except ValueError as error:  # an array of Python objects can contain code
                if "pickle" not in str(error):
                    raise
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
            if len({len(row or ()) for row in rows}) == 1:
                arrays[name] = np.array(rows, dtype=np.float64)
        elif types.is_string(column.type) or types.is_large_string(column.type):
            arrays[name] = np.array([text or "" for text in column.to_pylist()], dtype=np.str_)
        else:
            arrays[name] = column.to_numpy()
    return arrays
