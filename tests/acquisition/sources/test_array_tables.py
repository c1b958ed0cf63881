"""Import: arrays in MAT, NPZ, HDF5 and Parquet files, written by the libraries that users have."""

from __future__ import annotations

import sys
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pyarrow import parquet
from scipy.io import savemat

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.recording.recording import Recording
from acquisition.sources.array_files import read_arrays
from acquisition.sources.array_tables import write_array_tables
from config.errors import ConfigError, DataQualityError
from tests.builders.foreign_tables import ROWS, sound_table, two_joint_map
from tests.builders.raised_codes import raises_code

TABLE = sound_table()
T, Q, QD, CURRENT, TORQUE = TABLE[:, 0], TABLE[:, 1:3], TABLE[:, 3:5], TABLE[:, 5], TABLE[:, 6]
JOINTS = (
    {"joint": "a", "position": "q[0]", "velocity": "qd[0]", "current": "i"},
    {"joint": "b", "position": "q[1]", "velocity": "qd[1]", "torque": "torque"},
)


def named_map(prefix: str = "", **changes: object) -> ImportMap:
    joints = [
        {key: value if key == "joint" else prefix + value for key, value in joint.items()}
        for joint in JOINTS
    ]
    joints[0] |= {"torque_constant_nm_per_a": 2.0}  # type: ignore[dict-item]
    base = {"columns": None, "time": {"column": f"{prefix}t"}, "joints": joints}
    return two_joint_map(**(base | changes))


def read(path: Path, import_map: ImportMap, *further: Path) -> Recording:
    folder = path.parent / "tables"
    folder.mkdir(exist_ok=True)
    tables, layout = write_array_tables((path, *further), import_map, folder)
    return import_csv(tables[0], import_map, further=tables[1:], layout=layout)[0]


def contents(**changes: object) -> dict[str, Any]:
    return {"t": T, "q": Q, "qd": QD, "i": CURRENT, "torque": TORQUE} | changes


def save_npz(path: Path) -> ImportMap:
    records = np.zeros(ROWS, dtype=[("unused", "i4")])
    np.savez(path, allow_pickle=True, **contents(records=records, objects=np.array([{}, None])))
    return named_map()


def save_record_npz(path: Path) -> ImportMap:
    fields = [("t", "f8"), ("q", "f8", 2), ("qd", "f8", 2), ("i", "f8"), ("torque", "f8")]
    record = np.zeros(ROWS, dtype=fields)
    for name, value in contents().items():
        record[name] = value
    np.savez(path, log=record)
    return named_map("log.")


def save_matlab(path: Path) -> ImportMap:
    savemat(path, {"data": contents(q=Q.T, t=T.reshape(1, -1), note="x", names=["a", "b"])})
    return named_map("data.")


def save_matlab_73(path: Path) -> ImportMap:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in contents().items():  # MATLAB writes the dimensions in reverse
            file[f"data/{name}"] = np.atleast_2d(np.asarray(value).T)
        file["#refs#/a"] = np.zeros(3)
    with path.open("r+b") as file_again:
        file_again.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    return named_map("data.")


def save_hdf5(path: Path) -> ImportMap:
    with h5py.File(path, "w") as file:
        for name, value in contents().items():
            file[f"robot/arm/{name}"] = value
        file["robot/name"] = "arm"
    return named_map("robot/arm/")


def save_parquet(path: Path) -> ImportMap:
    stamps = pyarrow.array((T * 1e9).round().astype(np.int64), pyarrow.timestamp("ns", "UTC"))
    lists = pyarrow.array(QD.tolist(), pyarrow.list_(pyarrow.float64()))
    positions = pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(Q.ravel()), 2)
    nested = pyarrow.StructArray.from_arrays(
        [stamps, positions, lists, pyarrow.array(CURRENT), pyarrow.array(TORQUE)],
        ["t", "q", "qd", "i", "torque"],
    )
    parquet.write_table(pyarrow.table({"state": nested, "text": ["x"] * ROWS}), path)
    return named_map("state.", time={"column": "state.t", "unit": "ns"})


Save = Callable[[Path], ImportMap]
KINDS: dict[str, tuple[str, Save]] = {
    "npz": ("r.npz", save_npz),
    "record in npz": ("r.npz", save_record_npz),
    "MATLAB 5": ("r.mat", save_matlab),
    "MATLAB 7.3": ("r.mat", save_matlab_73),
    "HDF5": ("r.h5", save_hdf5),
    "HDF5, long extension": ("R.HDF5", save_hdf5),
    "Parquet": ("r.parquet", save_parquet),
}


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_of_files_give_the_same_recording(kind: str, tmp_path: Path) -> None:
    name, save = KINDS[kind]
    recording = read(tmp_path / name, save(tmp_path / name))
    np.testing.assert_array_equal(recording.position, Q)
    np.testing.assert_array_equal(recording.torque_nm, np.stack([2.0 * CURRENT, TORQUE], axis=1))
    np.testing.assert_allclose(np.diff(recording.time_s), np.diff(T), atol=2e-9)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    values=arrays.arrays(
        np.float64, st.tuples(st.integers(1, 30), st.just(1)), elements=st.floats(width=64)
    ),
    numbers=st.lists(st.integers(-(2**63), 2**63 - 1), min_size=30, max_size=30),
)
def test_each_number_keeps_all_its_digits(
    values: np.ndarray, numbers: list[int], tmp_path: Path
) -> None:
    samples = len(values)
    path = tmp_path / "r.npz"
    np.savez(path, t=np.array(numbers[:samples]), q=values)
    joints = [{"joint": "a", "position": "q[0]", "torque": "q"}]
    layout = named_map(time={"column": "t", "unit": "ns"}, joints=joints)
    (table,), _ = write_array_tables((path,), layout, tmp_path)
    rows = [line.split(",") for line in table.read_text().splitlines()]
    assert [int(row[0]) for row in rows] == numbers[:samples]
    written = np.array([float(row[1] or "nan") for row in rows])
    np.testing.assert_array_equal(written, values[:, 0])


def test_several_files_are_interpolated_to_the_first_ones_stamps(tmp_path: Path) -> None:
    np.savez(tmp_path / "q.npz", t=T, q=Q, qd=QD)
    np.savez(tmp_path / "torque.npz", t=T, i=CURRENT, torque=TORQUE)
    layout = named_map(further_files=[{}])
    recording = read(tmp_path / "q.npz", layout, tmp_path / "torque.npz")
    np.testing.assert_allclose(recording.torque_nm[:, 1], TORQUE, atol=1e-12)
    np.savetxt(tmp_path / "torque.csv", CURRENT)
    with raises_code(ConfigError, "RID-IMPORT-FILES", "torque.csv"):
        read(tmp_path / "q.npz", layout, tmp_path / "torque.csv")
    with raises_code(ConfigError, "RID-IMPORT-FILES", "2"):
        read(tmp_path / "q.npz", layout)


def test_rows_are_samples_counted_from_1(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    recording = read(path, save_npz(path))
    rows = named_map(rows={"first": 101, "last": 300})
    part = read(path, rows)
    np.testing.assert_array_equal(part.position, recording.position[100:300])


def test_an_error_in_the_samples_names_the_file_of_the_user(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    np.savez(path, allow_pickle=True, **contents(t=np.zeros_like(T)))
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "r.npz"):
        read(path, named_map())


@pytest.mark.parametrize(
    ("changes", "details"),
    [
        ({"t": T[:-1]}, ("'q[0]'", "(400, 2)", "399")),
        ({"q": Q[:, 0]}, ("'q[0]'", "(400,)")),
        ({"q": Q[:, :1]}, ("'q[1]'", "(400, 1)")),
        ({"torque": Q}, ("'torque'", "(400, 2)", "torque[0]")),
        ({"torque": np.zeros((20, 20))}, ("'torque'", "(20, 20)")),
    ],
)
def test_an_array_of_the_wrong_shape_is_refused(
    changes: dict[str, np.ndarray], details: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "r.npz"
    np.savez(path, allow_pickle=True, **contents(**changes))
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "r.npz", *details):
        read(path, named_map())


def test_a_missing_array_is_refused_with_those_that_exist(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    np.savez(path, allow_pickle=True, **contents())
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "'time'", "qd"):
        read(path, named_map(time={"column": "time"}))
    joints = [{"joint": "a", "position": "q[0]", "torque": "tau"}]
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "r.npz", "'tau'", "(400,)"):
        read(path, named_map(joints=joints))


def test_arrays_have_names_and_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    np.savez(path, allow_pickle=True, **contents())
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "r.npz", " 0 "):
        read(path, two_joint_map())


@pytest.mark.parametrize("name", ["r.npz", "r.mat", "r.h5", "r.parquet"])
def test_a_damaged_file_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"time,q\n1.0,2.0\n")
    with raises_code(ConfigError, "RID-FILE-TYPE", str(path)):
        read_arrays(path)
    path.unlink()
    with raises_code(ConfigError, "RID-FILE-READ", str(path)):
        read_arrays(path)


def test_a_format_without_its_library_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.h5"
    path.write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with raises_code(ConfigError, "RID-INSTALL-LIBRARY", str(path)):
        read_arrays(path)


def test_missing_values_of_a_parquet_file_keep_the_digits_of_the_others(tmp_path: Path) -> None:
    """A column of integers or dates with a missing value must not become one of floats."""
    path = tmp_path / "r.parquet"
    stamps = [None, 1_700_000_000_123_456_789, 1_700_000_000_133_456_791]
    rows = [[1.0, 2.0], None, [3.0, 4.0]]
    columns = {
        "count": pyarrow.array(stamps, pyarrow.int64()),
        "date": pyarrow.array(stamps, pyarrow.timestamp("ns", "UTC")),
        "since": pyarrow.array([0, 1_000, 2_000], pyarrow.duration("us")),
        "exact": pyarrow.array([None, Decimal("0.25"), Decimal("-3.5")], pyarrow.decimal128(9, 4)),
        "q": pyarrow.array(rows, pyarrow.list_(pyarrow.float64())),
    }
    parquet.write_table(pyarrow.table(columns), path)
    arrays = read_arrays(path)
    expected = ["", "1700000000123456789", "1700000000133456791"]
    assert arrays["count"].tolist() == arrays["date"].tolist() == expected
    assert arrays["since"].tolist() == [0, 1_000_000, 2_000_000]
    np.testing.assert_equal(arrays["exact"], [np.nan, 0.25, -3.5])
    np.testing.assert_equal(arrays["q"], [[1.0, 2.0], [np.nan, np.nan], [3.0, 4.0]])


def test_elements_of_a_matlab_structure_array_have_names(tmp_path: Path) -> None:
    """Simulink saves signals in the format "structure with time" in such an array."""
    path = tmp_path / "r.mat"
    signals = np.array([{"values": Q, "label": "q"}, {"values": QD, "label": "qd"}], dtype=object)
    savemat(path, {"logs": {"time": T, "signals": signals}})
    arrays = read_arrays(path)
    np.testing.assert_array_equal(arrays["logs.signals(2).values"], QD)
    assert arrays["logs.time"].shape == T.shape


def test_contents_that_are_objects_are_named(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    np.savez(path, allow_pickle=True, t=T, q=Q.astype(object))
    with raises_code(ConfigError, "RID-IMPORT-HEADER", "'q[0]'", "objects: q"):
        write_array_tables((path,), named_map(), tmp_path)
