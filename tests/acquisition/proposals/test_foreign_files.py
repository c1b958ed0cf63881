"""Files for which no map, or a doubtful map, is proposed: the text names the reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import h5py
import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from acquisition.proposals.propose import propose_map
from config.errors import ConfigError
from tests.acquisition.proposals.test_layouts_of_text import read_with, seconds, write
from tests.acquisition.proposals.test_propose import JOINTS, QD, ROBOT, TAU, Q, T, numbers, save
from tests.builders.raised_codes import raises_code


def test_topics_with_equal_stamps_are_merged(tmp_path: Path) -> None:
    """Each time has a row of positions, one of velocities and one of torques."""
    blank = ["nan"] * 3
    parts = [[map(str, row) for row in table.tolist()] for table in (Q, QD, TAU)]
    rows = [
        ",".join([stamp, *(cell for i in range(3) for cell in (part if i == which else blank))])
        for stamp, *cells in zip(seconds(), *parts, strict=True)
        for which, part in enumerate(cells)
    ]
    head = ",".join(["t", *numbers("q{n}"), *numbers("qd{n}"), *numbers("tau{n}")])
    path = tmp_path / "log.csv"
    path.write_text("\n".join([head, *rows, ""]))
    plain = read_with(write(tmp_path / "plain.csv", seconds()))
    np.testing.assert_allclose(read_with(path), plain, atol=1e-9)


@pytest.mark.parametrize(
    ("stamps", "named"),
    [
        ([f"08:{int(t // 60):02d}:{t % 60:06.3f}" for t in T.tolist()], ("08:00:00.000", "date")),
        ([f"{1e6 * t:,.3f}" for t in T.tolist()], ("10,000.000", "thousands")),
    ],
)
def test_unreadable_stamps_are_named(
    stamps: Sequence[str], named: tuple[str, ...], tmp_path: Path
) -> None:
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", *named):
        propose_map(write(tmp_path / "log.csv", stamps), ROBOT)


def test_torques_that_a_controller_computes_are_named(tmp_path: Path) -> None:
    names = ["timestamp", *numbers("actual_q_{n}"), *numbers("target_moment_{n}")]
    path = save(tmp_path / "log.csv", names, [T, Q, TAU])
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "target_moment_0", "model_based"):
        propose_map(path, ROBOT)


def test_too_few_columns_are_counted(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}")[:2], *numbers("tau{n}")[:2]]
    path = save(tmp_path / "log.csv", names, [T, Q[:, :2], TAU[:, :2]])
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "q{n} (2)", "tau{n} (2)"):
        propose_map(path, ROBOT)


def test_more_columns_than_joints_are_a_doubt(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}"), "q3", *numbers("tau{n}"), "tau3"]
    path = save(tmp_path / "log.csv", names, [T, Q, Q[:, 0], TAU, TAU[:, 0]])
    doubts = " ".join(propose_map(path, ROBOT).doubts)
    assert "q3" in doubts
    assert "tau3" in doubts


def test_arrays_of_other_lengths_are_a_doubt(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for episode, samples in (("first", 100), ("second", len(T))):
            for name, table in (("t", T), ("q", Q), ("tau", TAU)):
                file[f"{episode}/{name}"] = table[:samples]
    proposal = propose_map(path, ROBOT)
    assert proposal.keys["time"]["column"] == "second/t"
    assert "first/q" in " ".join(proposal.doubts)


@pytest.mark.parametrize(
    ("content", "code", "named"),
    [
        (b"", "RID-IMPORT-PROPOSAL", "empty"),
        (b"<?xml version='1.0'?><Log/>", "RID-IMPORT-FILES", "XML"),
        (b'<Rob Type="KUKA"><AIPos A1="0.0"/></Rob>', "RID-IMPORT-FILES", "XML"),
        (b"\x80\x04\x95 pickled", "RID-IMPORT-FILES", "pickle"),
        (b"ARROW1\0\0", "RID-IMPORT-FILES", "Feather"),
        (b"t q0 q1 q2\n" + b"0.0D+00 1.0D+00 1.0D+00 1.0D+00\n" * 9, "RID-IMPORT-PROPOSAL",
         "0.0D+00"),
    ],
)  # fmt: skip
def test_a_file_without_a_table_is_described(
    content: bytes, code: str, named: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.txt"
    path.write_bytes(content)
    with raises_code(ConfigError, code, named):
        propose_map(path, ROBOT)


def test_objects_in_a_file_without_arrays_are_named(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, data=np.array({"t": T, "q": Q}, dtype=object))
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "data"):
        propose_map(path, ROBOT)


def test_a_bag_without_efforts_is_refused(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/JointState"
    types: dict[str, Callable[..., object]] = dict(store.types)
    empty = np.array([])
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/joint_states", kind, typestore=store)
        for stamp, q in zip(T.tolist(), Q, strict=True):
            time = types["builtin_interfaces/msg/Time"](0, round(1e9 * stamp) % 10**9)
            header = types["std_msgs/msg/Header"](time, "")
            message = types[kind](header, list(JOINTS), q, empty, empty)
            writer.write(connection, round(1e9 * stamp), store.serialize_cdr(message, kind))
    with raises_code(ConfigError, "RID-BAG-TOPIC"):
        propose_map(tmp_path / "bag", ROBOT)
