"""Import maps that are proposed for files of known recorders; files without torques are refused.

The names and their order are those of ur_rtde 1.6.5, UR's `record.py`, libfranka 0.15, RSIPI 0.3.0,
abb_libegm, PlotJuggler, TwinCAT Scope View and our own export.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.known_sources import KNOWN_SOURCES, recognise
from acquisition.proposals.propose import propose_map
from acquisition.proposals.source_table import look_at
from config.arrays import FloatArray
from config.errors import ConfigError
from config.load import load_robot, to_yaml
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code

ROWS = 800
STEP_S = 0.008
NM_PER_A = np.array([joint.torque_constant_nm_per_a for joint in load_robot("ur10e").joints])
MAXIMUM_A = 40.0


class Motion(NamedTuple):
    """Time (m,) in s; positions, velocities and torques (m, n) in rad, rad/s and N m.

    The robot has n joints, the recording m rows.
    """

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque_nm: FloatArray

    @classmethod
    def of(cls, joints: int) -> Motion:
        t = STEP_S * np.arange(ROWS)
        angle = 1.5 * t[:, None] + np.arange(joints)
        velocity = 0.9 * np.cos(angle)
        torque_nm = 30.0 * np.cos(angle) + 3.0 * np.sign(velocity)
        return cls(np.asarray(t, dtype=np.float64), 0.6 * np.sin(angle), velocity, torque_nm)


def axes(pattern: str, count: int = 6, first: int = 0) -> list[str]:
    return [pattern.format(n) for n in range(first, first + count)]


def save(
    path: Path, names: list[str], rows: Iterable[Iterable[object]], separator: str = ","
) -> Path:
    lines = [separator.join(names), *(separator.join(map(str, row)) for row in rows), ""]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def rtde(folder: Path, motion: Motion, separator: str = ",") -> Path:
    """Write RTDE's fields.

    With commas, some rows are written twice, as by the recorder of ur_rtde, which polls.
    """
    t, q, qd, torque = motion
    vectors = {
        "target_q": q + 1e-3, "target_qd": qd, "target_qdd": -q, "target_current": torque / 12.0,
        "target_moment": 0.9 * torque, "actual_q": q, "actual_qd": qd,
        "actual_current": torque / NM_PER_A, "joint_control_output": torque / NM_PER_A,
        "actual_TCP_pose": q, "actual_TCP_speed": qd, "actual_TCP_force": torque,
        "joint_temperatures": np.full_like(q, 31.5), "actual_current_as_torque": 0.5 * torque,
    }  # fmt: skip
    names = ["timestamp", *(f"{name}_{n}" for name in vectors for n in range(6))]
    names += ["robot_mode", "safety_mode", "speed_scaling", "actual_main_voltage", "runtime_state"]
    still = np.tile([7.0, 1.0, 1.0, 48.1, 2.0], (ROWS, 1))
    rows = np.column_stack([t + 5230.0, *vectors.values(), still])
    if separator == ",":
        rows = np.repeat(rows, np.where(np.arange(ROWS) % 9 == 4, 2, 1), axis=0)
    return save(folder / "robot_data.csv", names, rows.tolist(), separator)


def spaces(folder: Path, motion: Motion) -> Path:
    return rtde(folder, motion, " ")


def libfranka(folder: Path, motion: Motion) -> Path:
    t, q, qd, torque = motion
    quantities = {
        "state.q": q, "state.q_d": q + 1e-3, "state.dq": qd, "state.dq_d": qd,
        "state.tau_J": torque, "state.tau_ext_hat_filtered": 0.1 * q, "cmd.q": q,
        "cmd.dq": qd, "cmd.tau_J": torque - 5.0,
    }  # fmt: skip
    names = ["time", "success_rate", *(f"{name}[{n}]" for name in quantities for n in range(7))]
    rows = np.column_stack([1e3 * t, np.full(ROWS, 0.98), *quantities.values()])
    return save(folder / "log.csv", names, rows.tolist())


def without_direction(folder: Path, motion: Motion) -> Path:
    """Write RSI's elements under their own names, as loggers of the robot's messages do."""
    percent = 100.0 * motion.torque_nm / NM_PER_A / MAXIMUM_A
    names = ["IPOC", *axes("AIPos_A{}", 6, 1), *axes("MACur_A{}", 6, 1), *axes("GearTorque_A{}")]
    stamps = np.round(1e3 * motion.time_s) + 4208163
    columns = [stamps, np.rad2deg(motion.position), percent, 0.5 * motion.torque_nm]
    return save(folder / "axes.csv", names, np.column_stack(columns).tolist())


def as_torque(folder: Path, motion: Motion) -> Path:
    names = ["timestamp", *axes("actual_q_{}"), *axes("actual_current_as_torque_{}")]
    rows = np.column_stack([motion.time_s, motion.position, motion.torque_nm])
    return save(folder / "as_torque.csv", names, rows.tolist())


def rsipi(folder: Path, motion: Motion) -> Path:
    """Write the values that the robot sends (`Send.`) and the corrections that it receives."""
    t, q, _, torque = motion
    pose = [f"Send.RIst.{name}" for name in "XYZABC"]
    names = ["Timestamp", *pose, *axes("Send.AIPos.A{}", 6, 1), *axes("Send.ASPos.A{}", 6, 1),
             *axes("Send.MACur.A{}", 6, 1), "Send.Delay", "Send.IPOC",
             *axes("Receive.AK.A{}", 6, 1), "Receive.IPOC"]  # fmt: skip
    deg = np.rad2deg(q)
    percent = 100.0 * torque / NM_PER_A / MAXIMUM_A
    rows = [
        [f"28/11/2026 08:00:{row // 125:02d}.{8 * (row % 125):03d}",
         *deg[row], *deg[row], *deg[row], *percent[row], 0,
         round(1e3 * t[row]) + 4208163, *np.zeros(6), round(1e3 * t[row]) + 4208163]
        for row in range(ROWS)
    ]  # fmt: skip
    return save(folder / "rsi.csv", names, rows)


def libegm(folder: Path, motion: Motion) -> Path:
    """Write abb_libegm's log, which has no torques."""
    t, q, qd, _ = motion
    names = ["TIMESTAMP", *axes("R_FB_POS_RJ{}", 6, 1), *axes("R_FB_POS_EJ{}", 6, 1),
             *axes("R_FB_VEL_RJ{}", 6, 1), *axes("R_FB_VEL_EJ{}", 6, 1)]  # fmt: skip
    deg, none = np.rad2deg(q), np.zeros((ROWS, 6))
    rows = np.column_stack([1e3 * t, deg, none, np.rad2deg(qd), none])
    return save(folder / "egm.csv", names, rows.tolist())


def plotjuggler(folder: Path, motion: Motion) -> Path:
    t, q, qd, torque = motion
    quantities = {"position": q, "velocity": qd, "effort": torque}
    names = [f"/joint_states/joint{n}/{name}" for name in quantities for n in range(1, 7)]
    rows = np.column_stack([t + 1.7643e9, *quantities.values()])
    return save(folder / "plot.csv", ["__time", *names], rows.tolist())


def scope_view(folder: Path, motion: Motion, delay_ms: float = 0.0) -> Path:
    """Write an export of TwinCAT Scope View, with one time column for each channel.

    The times of the fifth channel are `delay_ms` later.
    """
    channels = {
        **{f"Axis {i + 1}.ActPos": np.degrees(motion.position[:, i]) for i in range(6)},
        **{f"Axis {i + 1}.ActVelo": np.degrees(motion.velocity[:, i]) for i in range(6)},
        **{f"Axis {i + 1}.ActTorque": motion.torque_nm[:, i] for i in range(6)},
    }
    head = ["Name\tScope", "File\tC:\\scope.csv", "Starttime of export\t132959733843760000", "", ""]
    for key, value in (
        ("Name", None), ("SymbolComment", ""), ("Data-Type", "REAL64"), ("SampleTime[ms]", "8"),
        ("IndexGroup", "16448"), ("NetID", "192.168.1.20.1.1"), ("Unit", "(None)"),
    ):  # fmt: skip
        head.append("\t".join(f"{key}\t{name if value is None else value}" for name in channels))
    times = [1e3 * motion.time_s + (delay_ms if n == 4 else 0.0) for n in range(len(channels))]
    columns = [each for pair in zip(times, channels.values(), strict=True) for each in pair]
    rows = ["\t".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns)]
    text = "\n".join([*head, "", *rows, "EOF", ""])
    path = folder / "scope.csv"
    path.write_text(text.replace(".", ",") if delay_ms == 0.0 else text, encoding="utf-8")
    return path


def scope_view_with_one_time(folder: Path, motion: Motion) -> Path:
    """Write one time for all channels, separated by semicolons, with units and symbols.

    Rows and their order are those of an export by version 3.4.3145 with all rows of the header.
    """
    channels = {
        **{f"ActPos{f'({i})' * bool(i)}": np.degrees(motion.position[:, i]) for i in range(6)},
        **{f"ActTorque{f'({i})' * bool(i)}": motion.torque_nm[:, i] for i in range(6)},
    }
    rows_of_names = [
        ("Name", list(channels)),
        ("SymbolComment", [""] * 12),
        ("Data-Type", ["REAL64"] * 12),
        ("SampleTime[ms]", ["8"] * 12),
        ("SymbolName", [f"Axes.Axis {i % 6 + 1}.ToPlc.Act{'Torque' if i > 5 else 'Pos'}"
                        for i in range(12)]),
        ("ScaleFactor", ["1"] * 12),
        ("Unit", ["° (Angle)"] * 6 + ["Nm (Torque)"] * 6),
        ("Unit ScaleFactor", ["1"] * 12),
    ]  # fmt: skip
    head = ["Name;Scope;", "File;C:\\scope.csv;", "Starttime of export;132959733843760000", "", ""]
    head += [";".join([key, *cells]) for key, cells in rows_of_names]
    rows = np.column_stack([1e3 * motion.time_s, *channels.values()])
    lines = [";".join(f"{value:.12g}" for value in row) for row in rows]
    path = folder / "scope.csv"
    path.write_text("\n".join([*head, "", *lines, "EOF", ""]), encoding="utf-8-sig")
    return path


def own_export(folder: Path, motion: Motion) -> Path:
    names = ["time_s", *axes("position_joint{}_rad", 6, 1), *axes("torque_joint{}_nm", 6, 1)]
    state = np.tile([1.0, 3.0, -1.0], (ROWS, 1))
    rows = np.column_stack([motion.time_s, motion.position, motion.torque_nm, state])
    return save(folder / "run.csv", [*names, "valid", "phase", "sample_index"], rows.tolist())


class Recorder(NamedTuple):
    """Function that writes a recorder's file, its known source, and additions to the map."""

    write: Callable[[Path, Motion], Path]
    title: str
    units: dict[str, str]
    joints: int = 6
    added: dict[str, Any] | None = None


RECORDERS = (
    Recorder(rtde, "Universal Robots RTDE", {"position": "rad", "velocity": "rad/s"}),
    Recorder(spaces, "Universal Robots RTDE", {"position": "rad", "velocity": "rad/s"}),
    Recorder(libfranka, "Franka", {"position": "rad", "velocity": "rad/s"}, 7),
    Recorder(
        rsipi, "KUKA RSI", {"position": "deg", "current": "percent"}, 6,
        {"rated_current_a": MAXIMUM_A},
    ),
    Recorder(
        without_direction, "KUKA RSI", {"position": "deg", "current": "percent"}, 6,
        {"rated_current_a": MAXIMUM_A},
    ),
    Recorder(as_torque, "Universal Robots RTDE, without", {"position": "rad"}),
    Recorder(plotjuggler, "PlotJuggler", {"position": "rad", "velocity": "rad/s"}),
    Recorder(scope_view, "TwinCAT", {"position": "deg", "velocity": "deg/s"}),
    Recorder(scope_view_with_one_time, "TwinCAT", {"position": "deg", "torque": "Nm"}),
    Recorder(own_export, "rid-daq", {"position": "rad"}),
)  # fmt: skip


def robot_file(folder: Path, joints: int) -> tuple[str, RobotDescription]:
    """Return the name or the file of a robot with 6 or 7 joints, and the robot."""
    robot = load_robot("ur10e")
    if joints == 6:
        return "ur10e", robot
    extra = robot.joints[5].model_copy(update={"name": "joint7", "rotor": None})
    rows = (*robot.kinematics.rows, robot.kinematics.rows[5])
    seven = robot.model_copy(
        update={
            "joints": (*robot.joints, extra),
            "cad": None,
            "kinematics": robot.kinematics.model_copy(update={"rows": rows}),
        }
    )
    path = folder / "seven.yaml"
    path.write_text(to_yaml(seven))
    return str(path), seven


@pytest.mark.parametrize("recorder", RECORDERS, ids=lambda each: each.write.__name__)
def test_a_recorders_file_is_read_with_the_proposed_map(recorder: Recorder, tmp_path: Path) -> None:
    motion = Motion.of(recorder.joints)
    path = recorder.write(tmp_path, motion)
    source = recognise(look_at(path).names)
    assert source is not None
    assert source.title.startswith(recorder.title)
    reference, robot = robot_file(tmp_path, recorder.joints)
    proposal = propose_map(path, reference)
    assert (proposal.report is None) == bool(recorder.added)
    assert recorder.units.items() <= proposal.keys["units"].items()
    joints = [{**joint, **(recorder.added or {})} for joint in proposal.keys["joints"]]
    read = ImportMap.model_validate(proposal.keys | {"joints": joints}, strict=False)
    recording, report = import_csv(path, read, robot)
    assert report.rows_used == ROWS
    np.testing.assert_allclose(recording.position, motion.position, atol=1e-5)
    np.testing.assert_allclose(recording.torque_nm, motion.torque_nm, atol=1e-5)


def test_every_known_source_has_a_file_here() -> None:
    titles = [recorder.title for recorder in RECORDERS] + ["ABB EGM"]
    assert all(source.title.startswith(tuple(titles)) for source in KNOWN_SOURCES)


def test_a_log_of_positions_alone_is_refused(tmp_path: Path) -> None:
    path = libegm(tmp_path, Motion.of(6))
    source = recognise(look_at(path).names)
    assert source is not None
    assert source.title.startswith("ABB EGM")
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "egm.csv", "torques", "further_files"):
        propose_map(path, "ur10e")


@pytest.mark.parametrize("with_currents", [True, False])
def test_disturbance_torques_are_no_torques(tmp_path: Path, with_currents: bool) -> None:
    """FANUC's data monitor can record them. The names of its columns are not known for certain."""
    t, q, _, torque = Motion.of(6)
    names = ["Time [ms]", *axes("Joint Angle J{} [deg]", 6, 1), *axes("Disturb. Torque J{}", 6, 1)]
    columns = [1e3 * t, np.rad2deg(q), 0.1 * torque]
    if with_currents:
        names += axes("Motor Current J{} [A]", 6, 1)
        columns.append(torque / NM_PER_A)
    path = save(tmp_path / "fanuc.csv", names, np.column_stack(columns).tolist())
    if not with_currents:
        with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "Disturb.", "J3"):
            propose_map(path, "ur10e")
        return
    proposal = propose_map(path, "ur10e")
    assert any("Disturb. Torque J1" in doubt and "J3" in doubt for doubt in proposal.doubts)
    assert proposal.recording is not None
    np.testing.assert_allclose(proposal.recording.torque_nm, torque, atol=1e-5)


def test_channels_of_different_sample_times_are_refused(tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-IMPORT-PROPOSAL", "0", "8"):
        propose_map(scope_view(tmp_path, Motion.of(6), 0.5), "ur10e")


def test_full_time_stamps_of_a_scope_are_file_times(tmp_path: Path) -> None:
    motion = Motion.of(6)
    path = scope_view_with_one_time(tmp_path, motion)
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    for number, line in enumerate(lines):
        stamp, _, rest = line.partition(";")
        if stamp.replace(".", "").isdigit():
            ticks = 132_959_733_843_760_000 + round(1e4 * float(stamp))
            lines[number] = f"{ticks};{rest}"
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    proposal = propose_map(path, "ur10e")
    assert proposal.keys["time"] == {"column": 0, "unit": "filetime"}
    assert proposal.recording is not None
    span_s = np.ptp(proposal.recording.time_s)
    assert span_s == pytest.approx(np.ptp(motion.time_s), abs=1e-4)


def test_a_column_of_names_is_no_scope(tmp_path: Path) -> None:
    """A column `Name` alone does not identify TwinCAT Scope View: other logs can have one too."""
    t, q, _, torque = Motion.of(6)
    names = ["Name", "t", *axes("q{}"), *axes("tau{}")]
    rows = [["run 1", *row] for row in np.column_stack([t, q, torque]).tolist()]
    proposal = propose_map(save(tmp_path / "log.csv", names, rows), "ur10e")
    assert proposal.keys["time"] == {"column": "t", "unit": "s"}
    assert proposal.report is not None


@pytest.mark.parametrize("names_last", [False, True])
def test_columns_of_a_scope_are_numbered_because_its_names_are_in_several_rows(
    tmp_path: Path, names_last: bool
) -> None:
    names, units = "Name;q1;q2", "Unit;° (Angle);° (Angle)"
    header = [units, names] if names_last else [names, units]
    rows = [f"{8 * k};{k};{2 * k}" for k in range(5)]
    path = tmp_path / "scope.csv"
    path.write_text("\n".join([*header, *rows, ""]), encoding="utf-8")
    table = look_at(path)
    assert table.names[1:] == ("q1 [°]", "q2 [°]")
    assert not table.by_name
    assert table.keys["columns"] == 3
