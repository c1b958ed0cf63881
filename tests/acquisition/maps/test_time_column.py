"""Import: time stamps as numbers in several units, in two columns, and as dates."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.maps.time_column import Stamps, TimeColumn
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code, raises_invalid

NS = np.arange(300) * 10_000_000 + 1_700_000_000_123_456_789
T = 1e-9 * (NS - NS[0])
POSITION = np.sin(3.0 * T)
TORQUE = np.cos(5.0 * T)


def layout(time: str, columns: int = 3, more: str = "") -> ImportMap:
    joint = f'{{"joint": "a", "position": {columns - 2}, "torque": {columns - 1}}}'
    return ImportMap.model_validate_json(
        f'{{"name": "m", "robot": "r", "columns": {columns}, "time": {time}, "joints": [{joint}]'
        f"{more}}}"
    )


def save(path: Path, stamp: Callable[[int], str], delimiter: str = ",") -> Path:
    path.write_text(
        "".join(
            f"{stamp(int(ns))}{delimiter}{q!r}{delimiter}{tau!r}\n"
            for ns, q, tau in zip(NS, POSITION.tolist(), TORQUE.tolist(), strict=True)
        )
    )
    return path


def german(ns: int) -> str:
    """Return a date as Windows writes it in Germany, in quotation marks because of its comma."""
    when = datetime.fromtimestamp(ns // 10**9, UTC)
    return f'"{when:%d.%m.%Y %H:%M:%S},{ns % 10**9:09d}"'


def date(ns: int, zone: str = "", hours: float = 0.0) -> str:
    """Return a date with all nine digits of its nanoseconds."""
    when = datetime.fromtimestamp(ns // 10**9, UTC) + timedelta(hours=hours)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{ns % 10**9:09d}{zone}"


@pytest.mark.parametrize(
    ("stamp", "time", "columns"),
    [
        (str, '{"column": 0, "unit": "ns"}', 3),
        (
            lambda ns: f"{ns // 10**9},{ns % 10**9}",
            '{"column": 0, "nanoseconds": 1}',
            4,
        ),
        (
            lambda ns: f"{ns % 10**9},{ns // 10**9}.0",
            '{"column": 1, "nanoseconds": 0}',
            4,
        ),
        (date, '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns, "Z"), '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns, "+05:30", 5.5), '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns, "-0800", -8.0), '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns, "+02", 2.0), '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns, " UTC"), '{"column": 0, "unit": "iso"}', 3),
        (german, '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: date(ns).replace("-", "/"), '{"column": 0, "unit": "iso"}', 3),
        (lambda ns: f'"{date(ns).replace("T", " ")}"', '{"column": 0, "unit": "iso"}', 3),
    ],
)
def test_stamps_keep_every_nanosecond(
    tmp_path: Path, stamp: Callable[[int], str], time: str, columns: int
) -> None:
    recording, report = import_csv(save(tmp_path / "r.csv", stamp), layout(time, columns))
    assert report.rows_damaged == 0
    np.testing.assert_allclose(recording.time_s, T, atol=1e-12)
    np.testing.assert_array_equal(recording.position[:, 0], POSITION)


@pytest.mark.parametrize("text", [str, lambda ticks: f" {ticks}"])
def test_file_times_of_windows_keep_every_100_ns(
    tmp_path: Path, text: Callable[[int], str]
) -> None:
    """A space makes the text unusual: rows are then read one by one."""
    ticks_until_1970 = 116_444_736_000_000_000
    path = save(tmp_path / "r.csv", lambda ns: text(ticks_until_1970 + ns // 100))
    recording, report = import_csv(path, layout('{"column": 0, "unit": "filetime"}'))
    np.testing.assert_allclose(recording.time_s, T, atol=1e-12)
    assert report.time_origin_ns == NS[0] // 100 * 100


def test_file_times_are_read_block_by_block_if_they_fit() -> None:
    ticks_until_1970 = 116_444_736_000_000_000
    stamps = Stamps(TimeColumn(column=0, unit="filetime"))
    floats, ticks = np.empty((len(NS), 0)), ticks_until_1970 + NS[:, np.newaxis] // 100
    assert stamps.extend(floats, ticks)
    np.testing.assert_allclose(stamps.seconds(None)[0], T, atol=1e-12)
    assert not stamps.extend(floats, np.full_like(ticks, 2**62))


def test_minutes_are_read(tmp_path: Path) -> None:
    path = save(tmp_path / "r.csv", lambda ns: repr((ns - int(NS[0])) / 60e9))
    recording, _ = import_csv(path, layout('{"column": 0, "unit": "min"}'))
    np.testing.assert_allclose(recording.time_s, T, atol=1e-12)


def test_a_time_that_starts_again_is_refused_with_the_rows(tmp_path: Path) -> None:
    path = save(tmp_path / "r.csv", lambda ns: repr((ns - int(NS[0])) % 10**9 / 1e9))
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "101, 201"):
        import_csv(path, layout('{"column": 0}'))


def test_a_change_of_the_time_zone_is_not_a_time_step(tmp_path: Path) -> None:
    def summer_and_winter(ns: int) -> str:
        return date(ns, "+02:00", 2.0) if ns < NS[150] else date(ns, "+01:00", 1.0)

    path = save(tmp_path / "r.csv", summer_and_winter)
    recording, _ = import_csv(path, layout('{"column": 0, "unit": "iso"}'))
    np.testing.assert_allclose(recording.time_s, T, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("2023-11-14T25:00:00", '{"column": 0, "unit": "iso"}'),
        ("2023-02-30T10:00:00", '{"column": 0, "unit": "iso"}'),
        ("2023-11-14", '{"column": 0, "unit": "iso"}'),
        ("11/14/2023 22:13:20", '{"column": 0, "unit": "iso"}'),
        ("14.11.2023", '{"column": 0, "unit": "iso"}'),
        ("14.13.2023 22:13:20", '{"column": 0, "unit": "iso"}'),
        ("2023-11-14T22:13:20.5Z", '{"column": 0, "unit": "iso"}'),
        ("1_700_000_000", '{"column": 0, "unit": "ns"}'),
        ("nan", '{"column": 0, "unit": "ns"}'),
        ("99999999999999999999", '{"column": 0, "unit": "ns"}'),
    ],
)
def test_an_invalid_stamp_is_a_damaged_row(tmp_path: Path, text: str, time: str) -> None:
    """A row with a time zone among rows without one is also invalid."""
    stamp = str if "ns" in time else date
    path = save(tmp_path / "r.csv", lambda ns: text if ns == NS[100] else stamp(ns))
    _, report = import_csv(path, layout(time))
    assert [(group.first, group.counts) for group in report.damaged] == [
        (101, (("without a time stamp", 1),))
    ]


def test_nanoseconds_of_ten_digits_are_a_damaged_row(tmp_path: Path) -> None:
    path = save(
        tmp_path / "r.csv", lambda ns: f"{ns // 10**9},{ns % 10**9 + 10**9 * (ns == NS[7])}"
    )
    _, report = import_csv(path, layout('{"column": 0, "nanoseconds": 1}', 4))
    assert [group.first for group in report.damaged] == [8]


@pytest.mark.parametrize(
    ("stamp", "columns", "unit", "key"),
    [
        (date, 3, "s", "unit: iso"),
        (lambda ns: f"{ns // 10**9},{ns % 10**9}", 4, "s", "nanoseconds: 1"),
        (lambda ns: str(ns % 10**9), 3, "ns", "nanoseconds: 1"),
        (lambda ns: date(ns)[11:], 3, "iso", "unit: iso"),
        (lambda ns: f"11/14/2023 {date(ns)[11:]}", 3, "iso", "unit: iso"),
        (lambda ns: f"14-11-23 {date(ns)[11:]}", 3, "s", "unit: iso"),
        (lambda ns: repr((ns - int(NS[0])) / 1e9), 3, "ns", " ns"),
    ],
)
def test_the_refusal_names_the_key_that_reads_such_stamps(
    tmp_path: Path, stamp: Callable[[int], str], columns: int, unit: str, key: str
) -> None:
    path = save(tmp_path / "r.csv", stamp)
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", key):
        import_csv(path, layout(f'{{"column": 0, "unit": "{unit}"}}', columns))


def test_two_files_with_different_kinds_of_stamps_have_one_clock(tmp_path: Path) -> None:
    positions = save(tmp_path / "q.csv", lambda ns: date(ns, "+05:30", 5.5))
    torques = save(tmp_path / "tau.csv", str)
    further = ', "further_files": [{"columns": 3, "time": {"column": 0, "unit": "ns"}}]'
    import_map = layout('{"column": 0, "unit": "iso"}', 3, further)
    joints = (import_map.joints[0].model_copy(update={"torque": 5}),)
    import_map = import_map.model_copy(update={"joints": joints})
    recording, report = import_csv(positions, import_map, further=[torques])
    np.testing.assert_allclose(recording.torque_nm[:, 0], TORQUE, atol=1e-9)
    assert report.findings == ()


def test_nanoseconds_need_whole_seconds_and_a_column_of_their_own() -> None:
    with raises_invalid("time", "nanoseconds", "iso"):
        layout('{"column": 0, "nanoseconds": 1, "unit": "iso"}', 4)
    with raises_invalid("", "time", "position"):
        layout('{"column": 0, "nanoseconds": 2}', 4)
    with raises_invalid("", "4"):
        layout('{"column": 0, "nanoseconds": 4}', 4)
