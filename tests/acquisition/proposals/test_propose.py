"""Proposed import maps: columns are found by name, units are tried, and doubtful choices are
reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.proposal import Proposal
from acquisition.proposals.propose import propose_map
from config.errors import ConfigError
from config.load import load_robot, to_yaml
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_robot
from tests.builders.raised_codes import raises_code

ROBOT = "ir361"
JOINTS = ("axis1", "axis2", "axis3")
T = 0.01 * np.arange(600)
PHASES = np.array([0.0, 1.0, 2.0])
Q = 0.8 * np.sin(2.0 * T[:, None] + PHASES)
QD = 1.6 * np.cos(2.0 * T[:, None] + PHASES)
TAU = 90.0 * np.cos(2.0 * T[:, None] + PHASES) + 4.0 * np.sign(QD)


def numbers(pattern: str, first: int = 0) -> list[str]:
    return [pattern.format(n=first + i, joint=JOINTS[i]) for i in range(3)]


def save(
    path: Path, names: Sequence[str], columns: Sequence[np.ndarray], *before: str, sep: str = ","
) -> Path:
    rows = np.column_stack(columns)
    lines = [sep.join(f"{value:.12g}" for value in row) for row in rows]
    path.write_text("\n".join([*before, sep.join(names), *lines, ""]), encoding="utf-8")
    return path


def read(path: Path, proposal: Proposal) -> np.ndarray:
    """Return positions and torques as the proposed map reads them; velocities are left out."""
    import_map = ImportMap.model_validate(proposal.keys, strict=False)
    recording, _ = import_csv(path, import_map, load_robot(ROBOT))
    return np.hstack([recording.position, recording.torque_nm])


@pytest.mark.parametrize(
    ("time", "patterns", "first", "scales", "sep", "before"),
    [
        ("t", ("q{n}", "qd{n}", "tau{n}"), 0, (1.0, 1.0), ",", ()),
        ("# time", ("q_{n}", "dq_{n}", "tau_{n}"), 1, (1.0, 1.0), ",", ("# logger 2",)),
        ("time", ("state.q[{n}]", "state.dq[{n}]", "state.tau_J[{n}]"), 0, (1e3, 1.0), ",", ()),
        ("__time", ("/js/{joint}/position", "/js/{joint}/velocity", "/js/{joint}/effort"), 0,
         (1.0, 1.0), ",", ()),
        ("Time", ("Pos A{n} [deg]", "Vel A{n} [deg/s]", "Torque A{n}"), 1,
         (1e3, 180.0 / np.pi), ";", ()),
        ("zeit", ("ActPos{n}", "ActVel{n}", "ActTorque{n}"), 1, (1e6, 180.0 / np.pi), "\t", ()),
    ],
)  # fmt: skip
def test_columns_and_units_are_found(
    time: str,
    patterns: tuple[str, str, str],
    first: int,
    scales: tuple[float, float],
    sep: str,
    before: tuple[str, ...],
    tmp_path: Path,
) -> None:
    names = [time, *(name for pattern in patterns for name in numbers(pattern, first))]
    columns = [scales[0] * T, scales[1] * Q, scales[1] * QD, TAU]
    # QD's amplitude exceeds the limits in degrees, so that only degrees can be right
    path = save(tmp_path / "r.csv", names, columns, *before, sep=sep)
    proposal = propose_map(path, ROBOT)
    assert proposal.report is not None
    np.testing.assert_allclose(read(path, proposal), np.hstack([Q, TAU]), atol=2e-5)
    ratios = [ratio for ratio in proposal.report.velocity_ratio if ratio is not None]
    np.testing.assert_allclose(ratios, 1.0, atol=0.01)


def test_targets_and_commands_are_not_measurements(tmp_path: Path) -> None:
    names = ["t", *numbers("target_q_{n}"), *numbers("actual_q_{n}"), *numbers("tau_cmd_{n}"),
             *numbers("tau_{n}")]  # fmt: skip
    path = save(tmp_path / "r.csv", names, [T, 2.0 * Q, Q, 2.0 * TAU, TAU])
    proposal = propose_map(path, ROBOT)
    assert proposal.keys["joints"][0] == {
        "joint": "axis1",
        "position": "actual_q_0",
        "torque": "tau_0",
    }


def test_an_assumed_unit_is_a_doubt_and_a_stated_one_is_not(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n} [rad]"), *numbers("tau{n}")]
    proposal = propose_map(save(tmp_path / "r.csv", names, [T, Q, TAU]), ROBOT)
    (doubt,) = proposal.doubts
    assert doubt.split(":")[0] == "torque"


def test_a_second_choice_is_a_doubt(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}"), *numbers("tau{n}"), *numbers("tau_raw{n}")]
    proposal = propose_map(save(tmp_path / "r.csv", names, [T, Q, TAU, 3.0 * TAU]), ROBOT)
    assert any("tau_raw{n}" in doubt for doubt in proposal.doubts)


def test_names_above_a_row_of_units_become_numbers(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}"), *numbers("tau{n}")]
    path = tmp_path / "r.csv"
    save(path, ["s", *["rad"] * 3, *["Nm"] * 3], [T, Q, TAU], ",".join(names))
    proposal = propose_map(path, ROBOT)
    assert proposal.keys["header_rows"] == 2
    assert [joint["torque"] for joint in proposal.keys["joints"]] == [4, 5, 6]
    np.testing.assert_allclose(read(path, proposal), np.hstack([Q, TAU]), atol=1e-8)


def test_decimal_commas_and_iso_stamps_are_recognised(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-11-28T08:00:00.000", "ms") + np.arange(600) * 10
    rows = [
        ";".join([str(stamp), *(f"{value:.9f}".replace(".", ",") for value in row)])
        for stamp, row in zip(stamps, np.hstack([Q, TAU]), strict=True)
    ]
    names = ["Zeitstempel", *numbers("Pos{n}"), *numbers("Torque{n}")]
    path = tmp_path / "r.csv"
    path.write_text("\n".join([";".join(names), *rows]), encoding="utf-16")
    proposal = propose_map(path, ROBOT)
    assert proposal.keys["decimal"] == ","
    assert proposal.keys["time"] == {"column": "Zeitstempel", "unit": "iso"}
    np.testing.assert_allclose(read(path, proposal), np.hstack([Q, TAU]), atol=1e-7)


def test_arrays_are_proposed_by_name(tmp_path: Path) -> None:
    np.savez(tmp_path / "r.npz", time=T, q=Q, tau=TAU.T, note=np.array("x"))
    proposal = propose_map(tmp_path / "r.npz", ROBOT)
    assert proposal.report is not None
    assert proposal.keys["joints"][2] == {"joint": "axis3", "position": "q[2]", "torque": "tau[2]"}


def test_names_of_arrays_may_begin_with_a_space(tmp_path: Path) -> None:
    tables = {" time": T} | {f" q{i}": Q[:, i] for i in range(3)}
    np.savez(tmp_path / "r.npz", allow_pickle=True, **tables, **{" tau": TAU})
    proposal = propose_map(tmp_path / "r.npz", ROBOT)
    assert proposal.report is not None
    assert proposal.keys["joints"][0] == {"joint": "axis1", "position": " q0", "torque": " tau[0]"}


def test_an_impossible_recording_is_still_proposed_with_the_reason(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}"), *numbers("tau{n}")]
    proposal = propose_map(save(tmp_path / "r.csv", names, [T, 1e9 * Q, TAU]), ROBOT)
    assert proposal.report is None
    assert any("RID-IMPORT-ROWS" in reason for reason in (*proposal.reasons, *proposal.doubts))


@pytest.mark.parametrize(
    ("names", "columns", "detail"),
    [
        (["t", *numbers("q{n}")], [T, Q], "torques"),
        (["t", *numbers("tau{n}")], [T, TAU], "positions"),
        (["x", *numbers("q{n}"), *numbers("tau{n}")], [T, Q, TAU], "time"),
        (["t", *numbers("q{n}")[:2], *numbers("tau{n}")[:2]], [T, Q[:, :2], TAU[:, :2]], "q0"),
    ],
)
def test_a_file_without_recognisable_columns_is_refused(
    names: list[str], columns: list[np.ndarray], detail: str, tmp_path: Path
) -> None:
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "r.csv", detail):
        propose_map(save(tmp_path / "r.csv", names, columns), ROBOT)


@pytest.mark.parametrize(
    "text", ["", "hello\n" * 50, "t,q\n" + "1.0,2.0\n" * 50, "\x00\x01\xff" * 99]
)
def test_a_file_that_is_no_table_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(text)
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "r.csv"):
        propose_map(tmp_path / "r.csv", ROBOT)


def test_a_file_without_a_header_fits_a_bundled_map_or_is_refused(tmp_path: Path) -> None:
    t = 0.01 * np.arange(600)
    q = 0.5 * np.sin(2.0 * t[:, None] + np.arange(6))
    columns = [t, q, 1.0 * np.cos(2.0 * t[:, None] + np.arange(6)), q, q, q]
    np.savetxt(tmp_path / "r.csv", np.column_stack(columns), delimiter=",", fmt="%.9g")
    proposal = propose_map(tmp_path / "r.csv", "ur10e")
    assert proposal.keys["name"] == "ur10e_31"
    assert proposal.doubts == ()
    other = propose_map(tmp_path / "r.csv", "ur10")
    assert [joint["joint"] for joint in other.keys["joints"]] == list(
        load_robot("ur10").joint_names
    )
    assert other.keys["robot"] == "ur10"
    assert len(other.doubts) == 1
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "31"):
        propose_map(tmp_path / "r.csv", ROBOT)


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("[%]", "rated_torque_nm"),
        ("[‰]", "rated_torque_nm"),
        ("[0.1%]", "rated_torque_nm"),
        ("(1/1000)", "rated_torque_nm"),
        ("[N·m]", None),
        ("[mNm]", None),
    ],
)
def test_the_unit_in_brackets_is_used(unit: str, expected: str | None, tmp_path: Path) -> None:
    proposal = propose_map(_in_brackets(tmp_path, unit), str(tmp_path / "robot.yaml"))
    joint = proposal.keys["joints"][0]
    assert expected in joint if expected else "rated_torque_nm" not in joint
    assert not any("torque: the file does not state" in doubt for doubt in proposal.doubts)


def test_an_unknown_unit_in_brackets_is_refused(tmp_path: Path) -> None:
    path = _in_brackets(tmp_path, "[kp m]")
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "kp m"):
        propose_map(path, str(tmp_path / "robot.yaml"))


@pytest.mark.parametrize(
    ("time", "scale", "patterns"),
    [
        ("t/s", 1.0, ("q{n}/rad", "tau{n}/Nm")),
        ("t/msec", 1e3, ("q{n}/rad", "tau{n}/Nm")),
        ("ns", 1e9, ("q{n}", "tau{n}")),
        ("__index_level_0__", 1e9, ("q{n}", "tau{n}")),
        ("timeStamp", 1.0, ("jointPos{n}", "motorTorque{n}")),
        ("Time", 1.0, ("Axis {n} Actual Position", "Axis {n} Motor Torque")),
    ],
)
def test_other_styles_of_names_are_recognised(
    time: str, scale: float, patterns: tuple[str, str], tmp_path: Path
) -> None:
    names = [time, *(name for pattern in patterns for name in numbers(pattern, 1))]
    path = save(tmp_path / "r.csv", names, [np.round(scale * T, 6), Q, TAU])
    np.testing.assert_allclose(read(path, propose_map(path, ROBOT)), np.hstack([Q, TAU]), atol=1e-8)


@pytest.mark.parametrize("pattern", ["motorPos{n}", "Motor speed {n}", "Disturb torque A{n}"])
def test_values_that_are_not_of_the_joints_are_left_out(pattern: str, tmp_path: Path) -> None:
    names = ["t", *numbers(pattern), *numbers("q{n}"), *numbers("tau{n}")]
    path = save(tmp_path / "r.csv", names, [T, 50.0 * Q, Q, TAU])
    proposal = propose_map(path, ROBOT)
    assert set(proposal.keys["joints"][0]) == {"joint", "position", "torque"}
    assert proposal.keys["joints"][0]["torque"] == "tau0"


def test_whole_numbers_may_be_raw_values(tmp_path: Path) -> None:
    names = ["t", *numbers("q{n}"), *numbers("tau{n}")]
    raw = propose_map(save(tmp_path / "raw.csv", names, [T, Q, np.round(4.0 * TAU)]), ROBOT)
    assert any("permille" in doubt for doubt in raw.doubts)
    real = propose_map(save(tmp_path / "real.csv", names, [T, Q, TAU]), ROBOT)
    assert not any("permille" in doubt for doubt in real.doubts)


def test_dates_in_another_order_are_named(tmp_path: Path) -> None:
    rows = [f"11/28/2026 08:00:{row[0]:06.3f};1;2;3;4;5;6" for row in T[:50, None]]
    names = ["Zeit", *numbers("q{n}"), *numbers("tau{n}")]
    (tmp_path / "r.csv").write_text("\n".join([";".join(names), *rows, ""]))
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "Zeit", "11/28/2026"):
        propose_map(tmp_path / "r.csv", ROBOT)


def test_seconds_and_nanoseconds_are_one_time_stamp(tmp_path: Path) -> None:
    table = sound_table()
    lines = ["stamp.sec,stamp.nanosec,pos_a,pos_b,torque_a,torque_b"]
    for row in table:
        seconds, nanoseconds = divmod(round(row[0] * 1e9), 10**9)
        lines.append(f"{seconds},{nanoseconds},{row[1]},{row[2]},{row[5]},{row[6]}")
    (tmp_path / "rec.csv").write_text("\n".join(lines))
    (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    proposal = propose_map(tmp_path / "rec.csv", str(tmp_path / "robot.yaml"))
    expected = {"column": "stamp.sec", "nanoseconds": "stamp.nanosec", "unit": "s"}
    assert proposal.keys["time"] == expected
    assert proposal.report is not None


def _in_brackets(folder: Path, unit: str) -> Path:
    path = folder / "rec.csv"
    head = f"t,q1 [rad],q2 [rad],qd1,qd2,tau1 {unit},tau2 {unit}"
    path.write_text("\n".join([head, *as_lines(sound_table())]), encoding="utf-8")
    (folder / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    return path
