"""`find_time`: finds the columns of the time stamps of a recording, and their possible units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.maps.time_column import match_date
from acquisition.proposals.column_groups import TIME_UNITS
from acquisition.proposals.known_sources import KnownSource
from acquisition.proposals.source_table import SourceTable
from config.errors import ConfigError

_TIME_NAME: Final = re.compile(
    r"(__)?(time|t|(full)?timestamp|filetime|date_?time|stamp|zeit|zeitstempel|ipoc|secs?|seconds"
    r"|log_time)([^a-z].*)?"
    r"|ns|us|ms|(nano|micro|milli)seconds|__index_level_0__",  # the last is the index of pandas
    re.IGNORECASE,
)
_UNIT_AFTER_SLASH: Final = re.compile(rf"([^/]+)/({'|'.join(TIME_UNITS)})", re.IGNORECASE)
_UNIT_IN_BRACKETS: Final = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_LAST_WORD: Final = re.compile(r"(?:^|[\W_])([a-zµμ]+)$", re.IGNORECASE)
_STEPS_S: Final = (2e-4, 0.2)
_UNITS: Final = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("filetime", 1e-7))
_TIME_OF_DAY: Final = re.compile(r"\d\d?:\d\d(:\d\d([.,]\d+)?)?(\s*[ap]m)?", re.IGNORECASE)
_FILETIMES: Final = (1.2e17, 1.6e17)
"""Numbers of intervals of 100 ns from 1601 to 1981, and to 2108."""

_NANOSECONDS: Final = re.compile(r"(.*?)(nanoseconds|nanosecs?|nsecs?|ns)", re.IGNORECASE)
_WHOLE: Final = re.compile(r"[-+]?\d+")


def find_time(
    path: Path, table: SourceTable, source: KnownSource | None
) -> tuple[dict[str, str | int], tuple[str, ...], str]:
    """Return the columns of the time stamps, their possible units, the likeliest first, and why.

    Raises:
        ConfigError: No column of time stamps is recognised.
    """
    pair = None if source is not None or not table.by_name else _split_stamps(table.names)
    if pair is not None:
        columns = {"column": pair[0], "nanoseconds": pair[1]}
        return dict(columns), ("s",), f"time: seconds in {pair[0]}, nanoseconds in {pair[1]}"
    candidates = [n for n, name in enumerate(table.names) if _TIME_NAME.fullmatch(_last_part(name))]
    if source is not None:
        candidates = [_common_time(path, table, source)]
    unread = ""
    for number in candidates:
        name = table.names[number]
        column: str | int = name if table.by_name and table.names.count(name) == 1 else number
        texts = [row[number] for row in table.cells if row[number]]
        if source is not None:
            unit = "filetime" if _are_filetimes(texts) else source.time_unit
            return {"column": column}, (unit,), f"time: column {name}, unit {unit}"
        if all(match_date(text) for text in texts):
            return {"column": column}, ("iso",), f"time: column {name} has dates with a time of day"
        try:
            stamps = np.array([float(text.replace(",", ".")) for text in texts])
            stamps = stamps[np.isfinite(stamps)]
        except ValueError:
            unread = f" Column {name} {_unreadable(texts)}."
            continue
        steps = np.diff(stamps)
        if "empty_cells" in table.keys:  # rows of several topics may have the same time
            steps = steps[steps != 0.0]
        step = float(np.median(steps)) if len(steps) else 0.0
        if step <= 0.0 or np.mean(steps > 0.0) < 0.5:
            unread = unread or (
                f" Column {name} increases in only {100.0 * np.mean(steps > 0.0):.2g} % of the"
                " first rows: write time stamps with all their digits."
            )
            continue
        stated = _stated_unit(name)
        if stated is not None:
            if stated in TIME_UNITS.values():
                return {"column": column}, (stated,), f"time: column {name} states its unit"
            unread = f" Column {name} states the unit {stated}: convert it to s, ms, us or ns."
            continue
        is_filetime = _are_filetimes(texts)
        units = tuple(
            unit
            for unit, s in _UNITS
            if _STEPS_S[0] <= step * s <= _STEPS_S[1] and (unit == "filetime") == is_filetime
        )
        if "ns" in units and not all(_WHOLE.fullmatch(text) for text in texts):
            units = tuple(unit for unit in units if unit != "ns")
        if units:
            why = f"time: column {name} increases by {step:.6g} from row to row"
            return {"column": column}, units, why
        unread = (
            f" Column {name} increases by {step:.6g} from row to row, which is not a usual step"
            " in s, ms, us or ns."
        )
    raise ConfigError(
        f"{path}: no import map can be proposed, because no column of time stamps was recognised."
        f"{unread} Write a map with `time`, or with rate_hz (`rid-daq docs"
        " someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )


def _unreadable(texts: Sequence[str]) -> str:
    """Return the reason for which the time stamps of a column cannot be read."""
    first = next(text for text in texts if not is_number(text) and not match_date(text))
    if _TIME_OF_DAY.fullmatch(first):
        return f"has times of day without a date, such as {first!r}: write both in one column"
    if is_number(first.replace(",", "")):
        return f"has thousands separators, such as in {first!r}: write the numbers without them"
    return (
        f"contains neither plain numbers nor dates such as 2026-11-26T08:00:00.123 or 26.11.2026"
        f" 08:00:00,123, but {first!r}"
    )


def is_number(text: str) -> bool:
    """Return True if a text is a number with a decimal point or comma."""
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _last_part(name: str) -> str:
    """Return the last part of a name such as /joint_states/header.stamp, or the `t` of `t/s`."""
    with_unit = _UNIT_AFTER_SLASH.fullmatch(name.strip())
    return re.split(r"[./]", name.strip() if with_unit is None else with_unit[1])[-1]


def _split_stamps(names: Sequence[str]) -> tuple[str, str] | None:
    """Return the names of the columns of seconds and nanoseconds of one time stamp, or None."""
    for name in names:
        found = _NANOSECONDS.fullmatch(name.strip())
        if found is None:
            continue
        for seconds in ("sec", "secs", "seconds", "s"):
            whole = f"{found[1]}{seconds}"
            if names.count(whole) == 1 and names.count(name) == 1:
                return whole, name
    return None


def _common_time(path: Path, table: SourceTable, source: KnownSource) -> int:
    """Return the first column of time stamps of a known program.

    Raises:
        ConfigError: The columns of time stamps differ, so that a row has values of several times.
    """
    first, *others = (n for n, name in enumerate(table.names) if name == source.time)
    for other in others:
        if any(row[first] != row[other] for row in table.cells):
            raise ConfigError(
                f"{path}: columns {first} and {other}, both time stamps ({source.time}), differ:"
                " export all channels with one sample time, or with one time for all channels",
                code="RID-IMPORT-PROPOSAL",
            )
    return first


def _stated_unit(name: str) -> str | None:
    """Return the unit that the name of a column of time stamps states, as a map writes it.

    A unit in brackets that is not known is returned as it is. None if the name states no unit.
    """
    in_brackets = _UNIT_IN_BRACKETS.search(name.strip())
    if in_brackets is not None and in_brackets[1] and not in_brackets[1].isdigit():
        return TIME_UNITS.get(in_brackets[1].lower(), in_brackets[1])
    last = _LAST_WORD.search(name.strip())
    return None if last is None else TIME_UNITS.get(last[1].lower())


def _are_filetimes(texts: Sequence[str]) -> bool:
    """Return True if time stamps are whole intervals of 100 ns since 1601, as Windows counts."""
    low, high = _FILETIMES
    return all(_WHOLE.fullmatch(text) and low <= int(text) <= high for text in texts)
