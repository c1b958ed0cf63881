"""Export of a recording to CSV, Parquet, MAT (version 5) and MDF 4.

Nothing is resampled or rounded: each number reads back as it was recorded.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from acquisition.recording.table import RecordingTable
from config.errors import missing_library


class RecordingFormat(StrEnum):
    """File format of an exported recording."""

    CSV = "csv"
    PARQUET = "parquet"
    MAT = "mat"
    MDF4 = "mdf4"


def encode_recording(table: RecordingTable, form: RecordingFormat) -> bytes:
    """Return the contents of a file with the recording.

    Args:
        table: Recording to write.
        form: File format.

    Raises:
        ConfigError: The library that writes this format is not installed.
    """
    writers: dict[RecordingFormat, Callable[[RecordingTable], bytes]] = {
        RecordingFormat.CSV: _csv,
        RecordingFormat.PARQUET: _parquet,
        RecordingFormat.MAT: _mat,
        RecordingFormat.MDF4: _mdf4,
    }
    return writers[form](table)


def _csv(table: RecordingTable) -> bytes:
    """Return CSV (RFC 4180), with the shortest decimals that read back exactly."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([column.name for column in table.columns])
    writer.writerows(zip(*(column.values.tolist() for column in table.columns), strict=True))
    return text.getvalue().encode()


def _parquet(table: RecordingTable) -> bytes:
    import pyarrow as arrow  # a large import that other formats do not need
    from pyarrow import parquet

    fields = [
        arrow.field(column.name, arrow.from_numpy_dtype(column.values.dtype)).with_metadata(
            {"unit": column.unit}
        )
        for column in table.columns
    ]
    schema = arrow.schema(fields, metadata={"rid-daq": json.dumps(table.origin)})
    arrays = [arrow.array(np.ascontiguousarray(column.values)) for column in table.columns]
    buffer = io.BytesIO()
    parquet.write_table(arrow.Table.from_arrays(arrays, schema=schema), buffer)
    return buffer.getvalue()


def _mat(table: RecordingTable) -> bytes:
    from scipy.io import savemat

    # names of MAT variables have at most 63 characters; the units are in a variable of their own
    variables: dict[str, Any] = {
        column.name[:63]: column.values.reshape(-1, 1) for column in table.columns
    }
    variables["units"] = {column.name[:63]: column.unit for column in table.columns}
    variables["origin"] = table.origin
    with TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mat"
        savemat(str(path), variables, long_field_names=True, oned_as="column")
        # The library's header contains the time. Without it, equal recordings give equal files.
        return b"MATLAB 5.0 MAT-file, rid-daq".ljust(116) + path.read_bytes()[116:]


def _mdf4(table: RecordingTable) -> bytes:
    try:
        from asammdf import MDF, Signal
    except ImportError:
        raise missing_library("MDF 4", "mdf4") from None
    time_s, *others = table.columns
    with TemporaryDirectory() as folder, MDF(version="4.10") as file:
        signals = [
            Signal(
                samples=np.ascontiguousarray(column.values),
                timestamps=np.ascontiguousarray(time_s.values),
                name=column.name,
                unit=column.unit,
            )
            for column in others
        ]
        file.append(signals, comment=json.dumps(table.origin))
        written = file.save(Path(folder) / "recording.mf4", overwrite=True, compression=0)
        return Path(written).read_bytes()
