"""Advice to change a key names file and line in the user's original file, not in the run's copy."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.load import load_cell
from rid_daq.runs.origins import FileLine, key_lines, write_cell_origin, write_map_origin
from rid_daq.runs.run_data import ORIGINS

JOINTS = ("axis1", "axis2", "axis3")
DIRECTION = "cell.yaml axes.1.direction"


@pytest.fixture
def cell_file(tmp_path: Path) -> Path:
    for name, content in load_cell("ir361").files.items():
        (tmp_path / name).write_bytes(content)
    cell = tmp_path / "cell.yaml"
    cell.write_text(f"# mine\n{cell.read_text()}".replace("robot: ir361", "robot: robot.yaml"))
    return cell


def run_from_files(tmp_path: Path, reference: str) -> RunFolder:
    """Return a run folder in the state that `record` leaves at its start."""
    folder = RunFolder.create(tmp_path / "runs", "a run")
    loaded = load_cell(reference)
    for name, content in loaded.files.items():
        folder.write(name, content)
    write_cell_origin(folder, loaded)
    return folder


def lines_of(folder: RunFolder, *places: str) -> tuple[FileLine, ...]:
    return key_lines(folder, places, JOINTS)


def number_of(file: Path, text: str, which: int = 0) -> int:
    found = [n for n, line in enumerate(file.read_text().splitlines(), 1) if text in line]
    return found[which]


def test_a_key_is_shown_with_its_line_in_the_users_file(tmp_path: Path, cell_file: Path) -> None:
    folder = run_from_files(tmp_path, str(cell_file))
    node, row = lines_of(folder, "cell.yaml axes.1.node_id", "robot.yaml kinematics.rows.2.a_m")
    assert node.file == str(cell_file)
    assert node.line == number_of(cell_file, "node_id", 1)
    assert "node_id:" in str(node)
    robot = cell_file.with_name("robot.yaml")
    assert (row.file, row.line) == (str(robot), number_of(robot, "a_m: 0.480"))
    assert (node.remark, row.remark) == ("", "")


def test_a_missing_key_is_shown_at_the_first_line_of_its_axis(
    tmp_path: Path, cell_file: Path
) -> None:
    (line,) = lines_of(run_from_files(tmp_path, str(cell_file)), DIRECTION)
    assert not line.stated
    assert line.line == number_of(cell_file, "axis2")
    assert str(line) == f"{cell_file}:{line.line}: add direction"


def test_a_key_in_a_changed_file_is_shown_at_its_current_line(
    tmp_path: Path, cell_file: Path
) -> None:
    folder = run_from_files(tmp_path, str(cell_file))
    cell_file.write_text("\n\n\n" + cell_file.read_text())
    (line,) = lines_of(folder, "cell.yaml cycle_time_ms")
    assert line.line == number_of(cell_file, "cycle_time_ms")
    assert line.text is None  # the file has changed, so its text is not quoted
    assert str(line) == f"{cell_file}:{line.line}: cycle_time_ms (changed since the run)"


def test_a_key_of_a_deleted_file_is_shown_in_the_runs_copy(tmp_path: Path, cell_file: Path) -> None:
    folder = run_from_files(tmp_path, str(cell_file))
    cell_file.unlink()
    (line,) = lines_of(folder, "cell.yaml cycle_time_ms")
    assert line.file == str(folder.file("cell.yaml"))
    assert line.remark == f"the run's copy; {cell_file} can no longer be read"


def test_a_run_without_stored_origins_shows_its_copies(tmp_path: Path, cell_file: Path) -> None:
    folder = run_from_files(tmp_path, str(cell_file))
    folder.file(ORIGINS).unlink()
    (line,) = lines_of(folder, "cell.yaml cycle_time_ms")
    assert (line.file, line.remark) == (str(folder.file("cell.yaml")), "the run's copy")


def test_a_bundled_file_is_marked_as_bundled(tmp_path: Path) -> None:
    cell, robot = lines_of(
        run_from_files(tmp_path, "ir361"), "cell.yaml cycle_time_ms", "robot.yaml gravity_m_s2"
    )
    assert (cell.file, robot.file) == ("ir361.yaml (bundled)", "ir361.yaml (bundled)")
    assert cell.remark == "bundled with rid-daq: make your own copy"
    assert cell.text is not None
    assert cell.text.startswith("cycle_time_ms: ")


MESSAGES = """\
name: bag
robot: ir361
joint_states:
  effort: torque
  joints:
    - {joint: axis3, torque_sign: -1}
"""


def test_a_map_of_messages_names_only_the_joints_that_differ(tmp_path: Path) -> None:
    file = tmp_path / "bag.yaml"
    file.write_text(MESSAGES)
    folder = RunFolder.create(tmp_path / "runs", "a run", kind="import")
    folder.write("map.yaml", b"name: as read\n")
    write_map_origin(folder, str(file))
    third, second, order = lines_of(
        folder,
        "map.yaml joints.2.torque_sign",
        "map.yaml joints.1.position_sign",
        "map.yaml joints.0.position",
    )
    assert str(third) == f"{file}:6: - {{joint: axis3, torque_sign: -1}}"
    assert str(second) == f"{file}:5: add axis2.position_sign"
    assert str(order) == f"{file}:3: add names"
