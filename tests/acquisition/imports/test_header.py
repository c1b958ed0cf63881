"""Import: columns are named by the header of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from config.errors import ConfigError, DataQualityError
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map
from tests.builders.raised_codes import raises_code, raises_invalid

NAMES = ("time", "q_a", "q_b", "qd_a", "qd_b", "I [A]", "torque b")
BY_NAME = {
    "columns": None,
    "header_rows": 1,
    "time": {"column": "time"},
    "joints": [
        {
            "joint": "a",
            "position": "q_a",
            "velocity": "qd_a",
            "current": "I [A]",
            "torque_constant_nm_per_a": 2.0,
        },
        {"joint": "b", "position": "q_b", "velocity": "qd_b", "torque": "torque b"},
    ],
}


def named_map(**changes: object) -> ImportMap:
    return two_joint_map(**(BY_NAME | changes))


def save(path: Path, *head: str, separator: str = ",", table: np.ndarray | None = None) -> Path:
    lines = as_lines(sound_table() if table is None else table, separator)
    path.write_text("\n".join([*head, *lines, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "separator", "changes"),
    [
        ([",".join(NAMES)], ",", {}),
        (["# " + ", ".join(NAMES)], ",", {}),
        (["logger 3.1", "2026-11-28", ";".join(f'"{name}"' for name in NAMES)], ";", {}),
        (["\t".join(NAMES)], "\t", {}),
        (["%" + "\t".join(NAMES)], "\t", {"columns": 7}),
    ],
)
def test_named_columns_are_those_with_their_numbers(
    head: list[str], separator: str, changes: dict[str, object], tmp_path: Path
) -> None:
    expected, _ = import_csv(save(tmp_path / "plain.csv"), two_joint_map())
    delimiter = {"\t": "tab"}.get(separator, separator)
    layout = named_map(header_rows=len(head), delimiter=delimiter, **changes)
    recording, report = import_csv(save(tmp_path / "r.csv", *head, separator=separator), layout)
    np.testing.assert_array_equal(recording.position, expected.position)
    np.testing.assert_array_equal(recording.torque_nm, expected.torque_nm)
    assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)


def test_the_progress_of_the_reading_ends_with_the_last_row(tmp_path: Path) -> None:
    path, seen = save(tmp_path / "plain.csv"), list[tuple[Path, float]]()
    import_csv(path, two_joint_map(), watch=lambda file, share: seen.append((file, share)))
    assert {file for file, _ in seen} == {path}
    assert seen[-1][1] >= 0.99


def test_names_separated_by_spaces_and_numbers_may_be_mixed(tmp_path: Path) -> None:
    head = "t qa qb qda qdb current torque"
    joints = [
        {"joint": "a", "position": "qa", "current": 5, "torque_constant_nm_per_a": 2.0},
        {"joint": "b", "position": 2, "torque": "torque"},
    ]
    layout = named_map(delimiter="space", time={"column": 0}, joints=joints)
    recording, _ = import_csv(save(tmp_path / "r.txt", head, separator=" "), layout)
    np.testing.assert_allclose(recording.torque_nm[:, 1], sound_table()[:, 6], atol=1e-6)


def test_a_header_gives_the_number_of_columns(tmp_path: Path) -> None:
    layout = two_joint_map(columns=None, header_rows=1)
    _, report = import_csv(save(tmp_path / "r.csv", ",".join(NAMES)), layout)
    assert report.rows_damaged == 0


def test_names_are_looked_up_in_all_files_and_stamps_in_each(tmp_path: Path) -> None:
    table = sound_table()
    first = save(tmp_path / "q.csv", ",".join(NAMES[:5]), table=table[:, :5])
    second = save(
        tmp_path / "torque.csv", ",".join(("time", *NAMES[5:])), table=table[:, [0, 5, 6]]
    )
    recording, _ = import_csv(first, named_map(further_files=[{}]), further=[second])
    expected, _ = import_csv(save(tmp_path / "plain.csv"), two_joint_map())
    np.testing.assert_allclose(recording.torque_nm, expected.torque_nm, atol=1e-9)
    other = named_map(further_files=[{"time": {"column": "stamp"}}])
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "torque.csv", "'stamp'"):
        import_csv(first, other, further=[second])


@pytest.mark.parametrize(
    ("head", "changes", "details"),
    [
        (("time,q_a,q_b,qd_a,qd_b,i,torque b",), {}, ("'I [A]'", "q_a")),
        (("time,q_a,q_b,qd_a,qd_b,I [mA],torque b",), {}, ("'I [A]'", "I [mA]")),
        ((",".join(NAMES).replace("q_b", "q_a"),), {}, ("'q_a'", "1, 2")),
        ((), {"header_rows": 0}, ("'time'", "header_rows")),
        (("",), {}, ("row 1", "header_rows")),
        ((",".join(NAMES),), {"columns": 8}, ("7 columns", "8")),
    ],
)
def test_a_header_without_the_names_is_refused(
    head: tuple[str, ...], changes: dict[str, object], details: tuple[str, ...], tmp_path: Path
) -> None:
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "r.csv", *details):
        import_csv(save(tmp_path / "r.csv", *head), named_map(**changes))


def test_a_column_with_two_roles_is_refused(tmp_path: Path) -> None:
    joints = [*BY_NAME["joints"]]  # type: ignore[misc]
    joints[1] = {"joint": "b", "position": "q_b", "torque": 1}
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "column 1", "torque"):
        import_csv(save(tmp_path / "r.csv", ",".join(NAMES)), named_map(joints=joints))
    joints[1] = {"joint": "b", "position": "q_a", "torque": "torque b"}
    with raises_invalid("", "q_a", "of b"):
        named_map(joints=joints)


def test_numbers_without_the_number_of_columns_are_refused() -> None:
    with raises_invalid("", "of a", "columns", "header_rows"):
        two_joint_map(columns=None)


def test_a_finding_names_the_column_as_the_file_does(tmp_path: Path) -> None:
    table = sound_table()
    table[:, 4] *= 20.0
    path = save(tmp_path / "r.csv", ",".join(NAMES), table=table)
    wide = {"position": 10.0, "speed": 50.0, "torque": 100.0}
    with raises_code(DataQualityError, "RID-IMPORT-UNITS", "qd_b"):
        import_csv(path, named_map(plausible=wide))
