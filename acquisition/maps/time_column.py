"""`TimeColumn`: columns and unit of the time stamps of a file, and how their text is read."""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, model_validator

from config.arrays import FloatArray, IntArray
from config.model import ConfigModel

_NS = 10**9
_MOST_SECONDS = 9 * 10**9
_SECONDS = {"min": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6}
_TICKS_UNTIL_1970 = 116_444_736_000_000_000
"""Intervals of 100 ns from 1601 to 1970: Windows counts its file times from 1601."""

_MOST_TICKS = (1 << 63) // 100
"""Number of these intervals since 1970 from which their nanoseconds exceed 64 bits."""

_WHOLE = re.compile(r"[-+]?[0-9]+")
_CLOCK = (
    r"[Tt ](?P<h>\d\d?)(?P<ms>:\d\d:\d\d)(?:[.,](?P<part>\d{1,9}))?"
    r"\s*(?P<zone>[Zz]|UTC|[-+]\d\d(?::?\d\d)?)?"
)
_DATES = tuple(
    re.compile(date + _CLOCK, re.ASCII)
    for date in (
        r"(?P<y>\d{4})(?P<sign>[-/])(?P<m>\d\d)(?P=sign)(?P<d>\d\d)",
        r"(?P<d>\d\d?)\.(?P<m>\d\d?)\.(?P<y>\d{4})",
    )
)


def _check_column(value: object) -> object:
    """Return the value if it can be the number or the name of a column.

    Raises:
        ValueError: It is neither.
    """
    if isinstance(value, str):
        if value.strip():
            return value
        raise ValueError(f"{value!r} is not the name of a column")
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < MOST_COLUMNS:
        raise ValueError(
            f"a column is a whole number, 0 to {MOST_COLUMNS - 1}, or a name in the file's header"
        )
    return value


MOST_COLUMNS = 10_000
Column = Annotated[int | str, BeforeValidator(_check_column)]


def numbered(column: Column) -> int:
    """Return the number of a column of a map without names (`number_columns`)."""
    assert isinstance(column, int)
    return column


class TimeColumn(ConfigModel):
    """Column and unit of the time stamps; the steps between them may vary.

    Attributes:
        column: Column of the time stamps, counted from 0, or its name in the header.
        unit: Unit of the time stamps; `ns` are whole nanoseconds, `filetime` are whole intervals
            of 100 ns since 1601, as Windows counts them, `iso` are dates with a time of day
            (2026-11-26T08:00:00.123456+01:00, 2026/11/26 08:00:00 or 26.11.2026 08:00:00,123;
            without time zone UTC).
        nanoseconds: Additional column with the nanoseconds within the second; `column` has whole
            seconds.
    """

    column: Column
    unit: Literal["min", "s", "ms", "us", "ns", "filetime", "iso"] = "s"
    nanoseconds: Column | None = None

    @model_validator(mode="after")
    def _check_nanoseconds(self) -> TimeColumn:
        if self.nanoseconds is not None and self.unit != "s":
            raise ValueError(
                f"a column of nanoseconds belongs to whole seconds, but unit is {self.unit}: set"
                " unit: s, or remove nanoseconds"
            )
        return self

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns that hold the time stamps."""
        return (self.column,) if self.nanoseconds is None else (self.column, self.nanoseconds)


class Stamps:
    """Time stamps of one file.

    Whole nanoseconds since 1970 have more digits than a float. Stamps that consist of whole
    nanoseconds are therefore stored as integers, and returned relative to an origin.
    """

    def __init__(self, time: TimeColumn) -> None:
        self._time = time
        self._column = numbered(time.column)
        self._nanoseconds = None if time.nanoseconds is None else numbered(time.nanoseconds)
        self._exact = time.unit in ("ns", "filetime", "iso") or time.nanoseconds is not None
        self._ns, self._numbers = array("q"), array("d")
        self._has_zone: bool | None = None

    def append(self, fields: Sequence[str], read: Callable[[str], float]) -> None:
        """Read the stamp of one row.

        Args:
            fields: All fields of the row.
            read: Function that reads a number.

        Raises:
            ConfigError, ValueError, OverflowError: The fields are not a time stamp.
        """
        text = fields[self._column].strip()
        if self._nanoseconds is not None:
            part = _whole(fields[self._nanoseconds].strip(), read)
            if not 0 <= part < _NS:
                raise ValueError(f"{part} is not in 0 to 999999999 ns")
            self._ns.append(_whole(text, read) * _NS + part)
        elif self._time.unit == "ns":
            self._ns.append(int(text) if _WHOLE.fullmatch(text) else round(read(text)))
        elif self._time.unit == "filetime":
            self._ns.append((_whole(text, read) - _TICKS_UNTIL_1970) * 100)
        elif self._time.unit == "iso":
            self._ns.append(self._date(text))
        else:
            self._numbers.append(read(text))

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns that hold the time stamps."""
        return tuple(map(numbered, self._time.columns))

    @property
    def whole_columns(self) -> tuple[int, ...] | None:
        """Columns of whole numbers; empty if the stamps are floats, None if they are texts."""
        if self._time.unit == "iso":
            return None
        return self.columns if self._exact else ()

    def extend(self, floats: FloatArray, whole: IntArray) -> bool:
        """Add the stamps of several rows; add none and return False if one must be read alone.

        Args:
            floats: Shape (rows, 1 or 0). The column of time stamps, if it has floats.
            whole: Shape (rows, columns). The `whole_columns`.
        """
        if not self._exact:
            self._numbers.frombytes(floats.tobytes())
            return True
        stamps = whole[:, 0]
        if self._nanoseconds is not None:
            part = whole[:, 1]
            if (np.abs(stamps) >= _MOST_SECONDS).any() or ((part < 0) | (part >= _NS)).any():
                return False
            stamps = stamps * _NS + part
        elif self._time.unit == "filetime":
            ticks = stamps - _TICKS_UNTIL_1970
            if (np.abs(ticks) >= _MOST_TICKS).any():
                return False
            stamps = ticks * 100
        self._ns.frombytes(stamps.tobytes())
        return True

    def seconds(self, origin_ns: int | None) -> tuple[FloatArray, int]:
        """Return the stamps [s], and the time [ns] from which they are counted.

        Args:
            origin_ns: Origin of the first file; None if this is the first file.
        """
        if not self._exact:
            origin_ns = origin_ns or 0
            stamps = np.array(self._numbers, dtype=np.float64)
            return stamps * _SECONDS[self._time.unit] - origin_ns / _NS, origin_ns
        if origin_ns is None:
            origin_ns = self._ns[0] if self._ns else 0
        return (np.array(self._ns, dtype=np.int64) - origin_ns) / _NS, origin_ns

    def _date(self, text: str) -> int:
        """Return the nanoseconds since 1970 of a date with a time of day."""
        found = match_date(text)
        if found is None:
            raise ValueError(f"{text!r} is not a date with a time of day")
        zone = found["zone"]
        if self._has_zone not in (None, zone is not None):
            raise ValueError(f"{text!r}: some rows have a time zone, others have none")
        zone_text = "+00:00" if zone in (None, "Z", "z", "UTC") else zone
        date = f"{found['y']}-{found['m']:0>2}-{found['d']:0>2}"
        when = datetime.fromisoformat(f"{date}T{found['h']:0>2}{found['ms']}{zone_text}")
        self._has_zone = zone is not None
        seconds = when - datetime(1970, 1, 1, tzinfo=UTC)
        part = f"{found['part'] or '':0<9}"
        return (seconds.days * 86400 + seconds.seconds) * _NS + int(part)


def match_date(text: str) -> re.Match[str] | None:
    """Match a date with a time of day, as unit `iso` reads it; return None for another text.

    Dates such as 03/04/2026 are not read: some programs write the month first, others the day.
    """
    return next((found for each in _DATES if (found := each.fullmatch(text.strip()))), None)


def _whole(text: str, read: Callable[[str], float]) -> int:
    """Return a whole number; it may be written as 1700000000.0."""
    if _WHOLE.fullmatch(text):
        return int(text)
    number = read(text)
    if not number.is_integer():
        raise ValueError(f"{text!r} is not a whole number")
    return int(number)
