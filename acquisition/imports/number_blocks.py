"""`NumberBlocks`: converts whole blocks of lines to numbers, if every line is plain.

The result is the same as that of reading cell by cell (`row_reader.py`), but takes a tenth of the
time.

A block with anything unusual (a quoted or empty cell, a missing column, a text) is not converted:
its lines are then read one by one, which finds and names the damaged row.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.imports.lines import SEPARATORS
from acquisition.maps.import_map import ImportMap
from config.arrays import FloatArray, IntArray

_UNUSUAL: Final = ('"', "_", "(", "x", "X", "\0")
"""Characters of texts that `float` and pyarrow read differently, or that need a strict parser."""


class NumberBlocks:
    """Converter for the columns of one file.

    Args:
        import_map: Layout of the file.
        width: Number of columns of the file.
        floats: Columns with numbers; a column may occur several times.
        integers: Columns with whole numbers.
    """

    def __init__(
        self, import_map: ImportMap, width: int, floats: Sequence[int], integers: Sequence[int]
    ) -> None:
        from pyarrow import csv, float64, int64  # a large import that other commands do not need

        self._separator = SEPARATORS[import_map.delimiter]
        self._decimal = import_map.decimal
        self._floats = [str(column) for column in floats]
        self._integers = [str(column) for column in integers]
        self._width = width
        self._parsing = csv.ParseOptions(
            delimiter=self._separator or " ", quote_char=False, ignore_empty_lines=False
        )
        types = dict.fromkeys(self._floats, float64()) | dict.fromkeys(self._integers, int64())
        self._conversion = csv.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=[],
            decimal_point=self._decimal,
        )

    def convert(self, text: str) -> tuple[FloatArray, IntArray] | None:
        """Return the numbers of all lines, or None if a line is not plain.

        Args:
            text: Whole lines, each with a newline character at its end.

        Returns:
            Shapes (lines, floats) and (lines, integers).
        """
        import pyarrow
        from pyarrow import csv

        if not text.isascii() or any(character in text for character in _UNUSUAL):
            return None
        if self._decimal == "," and ("." in text or self._separator == ","):
            return None
        lines = text.count("\n")
        if self._separator is None:
            text = "".join(f"{' '.join(line.split())}\n" for line in text.split("\n")[:-1])
        data = text.encode("ascii")
        reading = csv.ReadOptions(
            use_threads=False,
            block_size=len(data) + 1,
            column_names=[str(column) for column in range(self._width)],
        )
        try:
            table = csv.read_csv(
                pyarrow.BufferReader(data), reading, self._parsing, self._conversion
            )
        except pyarrow.ArrowInvalid:
            return None
        if table.num_rows != lines:
            return None
        floats = np.empty((lines, len(self._floats)))
        integers = np.empty((lines, len(self._integers)), dtype=np.int64)
        for values, names in ((floats, self._floats), (integers, self._integers)):
            for place, name in enumerate(names):
                # `to_numpy` would import pandas, if it is installed
                pieces = map(np.from_dlpack, table.column(name).chunks)
                values[:, place] = np.concatenate([*pieces])
        return floats, integers
