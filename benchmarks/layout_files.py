"""`LAYOUTS`: writers of one recording in the file layouts of other programs."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final, Self

import h5py
import numpy as np
import pyarrow
from pyarrow import parquet
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from config.arrays import FloatArray

N: Final = 6
JOINTS: Final = tuple(f"joint{number}" for number in range(1, N + 1))
CONSTANTS: Final = np.array([11.976, 11.976, 9.839, 10.76, 10.76, 10.75])
"""Torque constants of the bundled map of this robot [N m/A]."""

RATED_A: Final = np.array([20.0, 20.0, 10.0, 5.0, 5.0, 5.0])
RATED_NM: Final = np.array([300.0, 300.0, 150.0, 60.0, 60.0, 60.0])
INCREMENTS: Final = 2**20
EPOCH_NS: Final = 1_700_000_000 * 10**9

Keys = Mapping[str, Any]


@dataclass(frozen=True)
class Source:
    """The original recording.

    Attributes:
        rows: Shape (samples, 31). The columns of the original file.
        t: Shape (samples,). Time stamps [s].
        q, qd, current, torque: Shape (samples, 6). Position [rad], velocity [rad/s], motor current
            [A] and torque at the link [N m].
    """

    rows: FloatArray
    t: FloatArray
    q: FloatArray
    qd: FloatArray
    current: FloatArray
    torque: FloatArray

    @classmethod
    def of(cls, rows: FloatArray) -> Self:
        """Return the recording in the columns of a UR10e's file."""
        q, qd, current = rows[:, 1:7], rows[:, 7:13], rows[:, 13:19]
        return cls(rows, rows[:, 0], q, qd, current, current * CONSTANTS)

    @property
    def ns(self) -> list[int]:
        """Time stamps in whole nanoseconds since 1970."""
        return [EPOCH_NS + round(stamp * 1e9) for stamp in self.t.tolist()]


@dataclass(frozen=True)
class Layout:
    """One layout.

    Attributes:
        name: Name in the table.
        write: Function that writes the files into a folder.
        keys: Keys of a map written by hand; None if the program proposes the map.
        known: For each key of a joint, values that only a person knows.
        has_velocity: False if the layout has no velocities; its motion is then less exact.
    """

    name: str
    write: Callable[[Path, Source], tuple[Path, ...]]
    keys: Keys | None = None
    known: Mapping[str, Sequence[float]] = field(default_factory=dict)
    has_velocity: bool = True


def names(pattern: str, first: int = 0) -> list[str]:
    """Return the names of the joints' columns: `{n}` is a number, `{j}` the joint's name."""
    return [pattern.format(n=first + number, j=JOINTS[number]) for number in range(N)]


RTDE: Final = [
    "timestamp",
    *names("target_q_{n}"),
    *names("actual_q_{n}"),
    *names("actual_qd_{n}"),
    *names("actual_current_{n}"),
    *names("target_moment_{n}"),
]
PLAIN: Final = ["t", *names("q{n}"), *names("qd{n}"), *names("tau{n}")]


def text(
    head: Sequence[str],
    columns: Callable[[Source], Sequence[Any]],
    *,
    separator: str = ",",
    decimal: str = ".",
    encoding: str = "utf-8",
    before: Sequence[str] = (),
    after: Sequence[str] = (),
    quoted: bool = False,
) -> Callable[[Path, Source], tuple[Path, ...]]:
    """Return a writer of a text table; numbers have all digits, other cells are texts."""

    def cell(value: Any) -> str:
        shown = repr(float(value)) if isinstance(value, float) else str(value)
        shown = shown.replace(".", decimal) if isinstance(value, float) else shown
        return f'"{shown}"' if quoted else shown

    def write(folder: Path, source: Source) -> tuple[Path, ...]:
        path = folder / "recording.csv"
        lists = [
            each.tolist() if isinstance(each, np.ndarray) else each for each in columns(source)
        ]
        rows = zip(*lists, strict=True)
        lines = [*before, *([separator.join(head)] if head else []), *after]
        lines += [separator.join(cell(value) for value in _flat(row)) for row in rows]
        path.write_text("\n".join([*lines, ""]), encoding=encoding)
        return (path,)

    return write


def _flat(row: Iterable[Any]) -> Iterable[Any]:
    for value in row:
        if isinstance(value, list):
            yield from value
        else:
            yield value


def _joints(pattern: Mapping[str, str | int], **more: Sequence[float]) -> list[dict[str, Any]]:
    """Return the joints of a map by hand; a number is the column of the first joint."""
    return [
        {
            "joint": joint,
            **{
                key: each + number if isinstance(each, int) else each.format(n=number, j=joint)
                for key, each in pattern.items()
            },
            **{key: float(values[number]) for key, values in more.items()},
        }
        for number, joint in enumerate(JOINTS)
    ]


def _arrays(source: Source) -> dict[str, FloatArray]:
    return {"t": source.t, "q": source.q, "qd": source.qd, "tau": source.torque}


def _npz(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.npz"
    np.savez(path, allow_pickle=True, **_arrays(source))
    return (path,)


def _matlab(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.mat"
    savemat(path, {"log": {name: each.T for name, each in _arrays(source).items()}})
    return (path,)


def _matlab_73(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, each in _arrays(source).items():
            file[f"log/{name}"] = np.atleast_2d(each.T)
    return (path,)


def _hdf5(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.h5"
    with h5py.File(path, "w") as file:
        for name, each in _arrays(source).items():
            file[f"arm/{name}"] = each
    return (path,)


def _parquet(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.parquet"
    stamps = pyarrow.array(source.ns, pyarrow.timestamp("ns", "UTC"))
    columns = {"time": stamps}
    for name, each in _arrays(source).items():
        if name != "t":
            columns |= {f"{name}_{number}": pyarrow.array(each[:, number]) for number in range(N)}
    parquet.write_table(pyarrow.table(columns), path)
    return (path,)


def _parquet_lists(folder: Path, source: Source) -> tuple[Path, ...]:
    path = folder / "recording.parquet"
    columns = {name: pyarrow.array(each.tolist()) for name, each in _arrays(source).items()}
    parquet.write_table(pyarrow.table(columns), path)
    return (path,)


def _two_files(folder: Path, source: Source) -> tuple[Path, ...]:
    paths = folder / "q.csv", folder / "tau.csv"
    for path, columns in zip(paths, ((source.q, source.qd), (source.torque,)), strict=True):
        rows = np.column_stack([source.t, *columns])
        np.savetxt(path, rows, delimiter=",", fmt="%.17g")
    return paths


def _merged_topics(folder: Path, source: Source) -> tuple[Path, ...]:
    """Write motions and efforts in rows of their own, the other cells empty."""
    path = folder / "recording.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(PLAIN)
        motion = np.hstack([source.q, source.qd]).tolist()
        for stamp, q, tau in zip(source.t.tolist(), motion, source.torque.tolist(), strict=True):
            writer.writerow([stamp, *q, *[""] * N])
            writer.writerow([stamp, *[""] * 2 * N, *tau])
    return (path,)


def bag_writer(storage: StoragePlugin) -> Callable[[Path, Source], tuple[Path, ...]]:
    """Return a writer of a ROS 2 bag with joint states, whose efforts are the torques."""

    def write(folder: Path, source: Source) -> tuple[Path, ...]:
        path = folder / "bag"
        store = get_typestore(Stores.ROS2_HUMBLE)
        types = store.types
        joint_state = types["sensor_msgs/msg/JointState"]
        header, stamp_of = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
        order = [2, 1, 0, 3, 4, 5]  # as UR's driver publishes them
        with Writer(path, version=9, storage_plugin=storage) as writer:
            connection = writer.add_connection(
                "/joint_states", joint_state.__msgtype__, typestore=store
            )
            for row, ns in enumerate(source.ns):
                message = joint_state(
                    header(stamp_of(*divmod(ns, 10**9)), ""),
                    [JOINTS[joint] for joint in order],
                    source.q[row, order],
                    source.qd[row, order],
                    source.torque[row, order],
                )
                raw = store.serialize_cdr(message, joint_state.__msgtype__)
                writer.write(connection, ns, raw)
        return (path,)

    return write


def _iso(source: Source, zone: str) -> list[str]:
    hours = {"Z": 0, "+01:00": 1}[zone]
    origin = datetime(2026, 11, 28, 8, tzinfo=UTC) + timedelta(hours=hours)
    stamps = []
    for stamp in source.t.tolist():
        seconds, ns = divmod(round(stamp * 1e9), 10**9)
        when = (origin + timedelta(seconds=seconds)).strftime("%Y-%m-%dT%H:%M:%S")
        stamps.append(f"{when}.{ns:09d}{zone}")
    return stamps


def _rtde(source: Source) -> list[Any]:
    return [source.t, 1.01 * source.q, source.q, source.qd, source.current, source.rows[:, 25:31]]


def _plain(source: Source) -> list[Any]:
    return [source.t, source.q, source.qd, source.torque]


def _degrees(source: Source) -> list[Any]:
    return [1e3 * source.t, np.rad2deg(source.q), np.rad2deg(source.qd), source.torque]


def _nanoseconds(source: Source) -> list[Any]:
    return [source.ns, source.q, source.qd, source.torque]


BY_NUMBER: Final = {
    "columns": 19,
    "time": {"column": 0},
    "joints": _joints({"position": 1, "velocity": 7, "torque": 13}),
}

LAYOUTS: Final = (
    Layout("31 columns without a header", text([], lambda s: [s.rows])),
    Layout("ur_rtde", text(RTDE, _rtde)),
    Layout("UR's RTDE recorder, spaces", text(RTDE, _rtde, separator=" ")),
    Layout("libfranka", text(
        ["time", *names("state.q[{n}]"), *names("state.q_d[{n}]"), *names("state.dq[{n}]"),
         *names("state.tau_J[{n}]"), *names("state.tau_J_d[{n}]")],
        lambda s: [1e3 * s.t, s.q, s.q + 0.01, s.qd, s.torque, 0.5 * s.torque])),
    Layout("KUKA RSI, percent of maximum current", text(
        ["Timestamp", "Send.IPOC", *names("Send.AIPos.A{n}", 1),
         *names("Send.ASPos.A{n}", 1), *names("Send.MACur.A{n}", 1)],
        lambda s: [_iso(s, "Z"), 1e3 * s.t, np.rad2deg(s.q), np.rad2deg(s.q),
                   100.0 * s.current / RATED_A]),
        known={"rated_current_a": RATED_A.tolist()}, has_velocity=False),
    Layout("PlotJuggler", text(
        ["__time", *names("/joint_states/{j}/position"), *names("/joint_states/{j}/velocity"),
         *names("/joint_states/{j}/effort")], _plain)),
    Layout("plain names", text(PLAIN, _plain)),
    Layout("tabs", text(PLAIN, _plain, separator="\t")),
    Layout("header as a comment", text(["# t", *PLAIN[1:]], _plain)),
    Layout("header after three lines of a logger", text(
        PLAIN, _plain, before=["logger 3.1", "robot UR10e", "2026-11-28"])),
    Layout("row of units below the header", text(
        PLAIN, _plain, after=["s" + ",rad" * N + ",rad/s" * N + ",Nm" * N])),
    Layout("names of joints", text(
        ["time", *names("{j}_position"), *names("{j}_velocity"), *names("{j}_torque")], _plain)),
    Layout("other columns between", text(
        ["time", "mode", *names("q_{n}", 1), "speed_scaling", *names("dq_{n}", 1),
         *names("tau_{n}", 1)],
        lambda s: [s.t, ["RUN"] * len(s.t), s.q, np.ones(len(s.t)), s.qd, s.torque])),
    Layout("degrees, milliseconds, decimal commas", text(
        ["Zeit [ms]", *names("Pos A{n} [deg]", 1), *names("Vel A{n} [deg/s]", 1),
         *names("Moment A{n} [Nm]", 1)], _degrees, separator=";", decimal=",")),
    Layout("degrees without units in the names", text(
        ["time", *names("Pos{n}", 1), *names("Vel{n}", 1), *names("Torque{n}", 1)], _degrees)),
    Layout("revolutions and rpm", text(
        ["time", *names("pos{n}", 1), *names("speed{n}", 1), *names("torque{n}", 1)],
        lambda s: [s.t, s.q / (2 * np.pi), s.qd * 30 / np.pi, s.torque]), {
            "header_rows": 1, "time": {"column": "time"},
            "units": {"position": "rev", "velocity": "rpm"},
            "joints": [{"joint": joint, "position": f"pos{n}", "velocity": f"speed{n}",
                        "torque": f"torque{n}"} for n, joint in enumerate(JOINTS, 1)]}),
    Layout("milliamperes", text(
        ["time", *names("q{n}"), *names("qd{n}"), *names("I{n} [mA]")],
        lambda s: [s.t, s.q, s.qd, 1e3 * s.current])),
    Layout("per mille of the rated torque", text([], lambda s: [
        s.t, s.q, s.qd, 1e3 * s.torque / RATED_NM]), {
            **BY_NUMBER, "units": {"torque": "permille"},
            "joints": _joints({"position": 1, "velocity": 7, "torque": 13},
                              rated_torque_nm=RATED_NM.tolist())}),
    Layout("increments", text([], lambda s: [
        s.t, s.q * INCREMENTS / (2 * np.pi), s.qd * INCREMENTS / (2 * np.pi), s.torque]), {
            **BY_NUMBER, "units": {"position": "increments", "velocity": "increments/s"},
            "joints": _joints({"position": 1, "velocity": 7, "torque": 13},
                              increments_per_rev=[INCREMENTS] * N)}),
    Layout("UTF-8 with a byte order mark", text(PLAIN, _plain, encoding="utf-8-sig")),
    Layout("UTF-16", text(PLAIN, _plain, encoding="utf-16")),
    Layout("UTF-16 without a byte order mark", text(PLAIN, _plain, encoding="utf-16-le")),
    Layout("quoted decimal commas", text(PLAIN, _plain, decimal=",", quoted=True)),
    Layout("nanoseconds since 1970", text(PLAIN, _nanoseconds)),
    Layout("seconds and nanoseconds", text(["sec", "nanosec", *PLAIN[1:]], lambda s: [
        [ns // 10**9 for ns in s.ns], [ns % 10**9 for ns in s.ns], s.q, s.qd, s.torque])),
    Layout("ISO 8601 in UTC", text(PLAIN, lambda s: [_iso(s, "Z"), *_plain(s)[1:]])),
    Layout("ISO 8601 with a time zone", text(PLAIN, lambda s: [_iso(s, "+01:00"), *_plain(s)[1:]])),
    Layout("topics merged into one file", _merged_topics),
    Layout("two files", _two_files, {
        "columns": 13, "time": {"column": 0}, "further_files": [{"columns": 7}],
        "joints": _joints({"position": 1, "velocity": 7, "torque": 14})}),
    Layout("NPZ", _npz),
    Layout("MATLAB 5, structure", _matlab),
    Layout("MATLAB 7.3, structure", _matlab_73),
    Layout("HDF5", _hdf5),
    Layout("Parquet", _parquet),
    Layout("Parquet, lists", _parquet_lists),
    Layout("ROS 2 bag, sqlite3", bag_writer(StoragePlugin.SQLITE3)),
    Layout("ROS 2 bag, MCAP", bag_writer(StoragePlugin.MCAP)),
)  # fmt: skip
