"""Proposed import maps: columns are found by name, units are tried, doubts are said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.import_map import ImportMap
from acquisition.imports.read import import_csv
from acquisition.proposals.propose import Proposal, propose_map
from config.errors import ConfigError
from config.load import load_robot
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
    """Positions, velocities are left out, and torques as the proposed map reads them."""
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


def scope_export(path: Path, delay_ms: float = 0.0) -> Path:
    """Write a file as TwinCAT Scope View exports it, with one time column for each channel."""
    channels = {
        **{f"Axis {i + 1}.ActPos": np.degrees(Q[:, i]) for i in range(3)},
        **{f"Axis {i + 1}.ActVelo": np.degrees(QD[:, i]) for i in range(3)},
        **{f"Axis {i + 1}.ActTorque": TAU[:, i] for i in range(3)},
    }
    head = ["Name\tScope", "File\tC:\\scope.csv", "Starttime of export\t132959733843760000", "", ""]
    for key, value in (
        ("Name", None), ("SymbolComment", ""), ("Data-Type", "REAL64"), ("SampleTime[ms]", "10"),
        ("IndexGroup", "16448"), ("NetID", "192.168.1.20.1.1"), ("Unit", "(None)"),
    ):  # fmt: skip
        head.append("\t".join(f"{key}\t{name if value is None else value}" for name in channels))
    times = [1e3 * T + (delay_ms if n == 4 else 0.0) for n in range(len(channels))]
    columns = [each for pair in zip(times, channels.values(), strict=True) for each in pair]
    rows = ["\t".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns)]
    text = "\n".join([*head, "", *rows, "EOF", ""])
    path.write_text(text.replace(".", ",") if delay_ms == 0.0 else text, encoding="utf-8")
    return path


def test_an_export_of_twincat_scope_view_is_recognised(tmp_path: Path) -> None:
    path = scope_export(tmp_path / "scope.csv")
    proposal = propose_map(path, ROBOT)
    assert proposal.keys["units"]["position"] == "deg"
    assert proposal.keys["time"] == {"column": 0, "unit": "ms"}
    assert any("permille" in doubt for doubt in proposal.doubts)
    np.testing.assert_allclose(read(path, proposal), np.hstack([Q, TAU]), atol=3e-5)
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "0", "8"):
        propose_map(scope_export(tmp_path / "late.csv", 0.5), ROBOT)


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


def test_percent_of_an_unknown_current_is_left_to_the_person(tmp_path: Path) -> None:
    names = ["Receive.IPOC", *numbers("Receive.AIPos.A{n}", 1), *numbers("Receive.ASPos.A{n}", 1),
             *numbers("Receive.MACur.A{n}", 1)]  # fmt: skip
    columns = [1e3 * T, np.rad2deg(Q), np.rad2deg(Q), TAU / 2.0]
    proposal = propose_map(save(tmp_path / "r.csv", names, columns), ROBOT)
    assert proposal.report is None
    assert proposal.keys["joints"][0]["position"] == "Receive.AIPos.A1"
    assert proposal.keys["joints"][0]["rated_current_a"] == "?"
    assert proposal.keys["units"] == {"position": "deg", "current": "percent"}


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
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "31"):
        propose_map(tmp_path / "r.csv", ROBOT)
