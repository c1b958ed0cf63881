"""Cell, robot and motion files that clients edit: checks, versions, roles, other editors."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from config.load import bundled_names, load_cell
from rid_daq.service.files.editors import PRESENT_S, Editors
from rid_daq.service.records import Identity, Role
from tests.rid_daq.service.editing import Editing

ANNA, BERT = (
    Identity(name=name, role=Role.OPERATOR, person=True, token=name) for name in ("Anna", "Bert")
)
MOTION = """robot: ir361
kind: pose_sequence
points:
- [0.0, 0.0, 0.0]
- [0.2, 0.1, 0.1]
"""


@pytest.fixture
def editing(tmp_path: Path) -> Editing:
    return Editing(tmp_path)


def refusal(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["code"]


@pytest.mark.promise("edited-files")
def test_a_motion_is_made_replaced_and_never_overwritten_silently(editing: Editing) -> None:
    made = editing.save(Role.OPERATOR, "m/poses.yaml", MOTION, "")
    assert made.status_code == 201
    first = editing.version("m/poses.yaml")
    assert made.json()["version"] == first
    read = editing.ask(Role.VIEWER, "GET", "m/poses.yaml")
    assert (read.text, read.headers["etag"]) == (MOTION, f'"{first}"')
    slow = MOTION + "speed_fraction: 0.1\n"
    assert editing.save(Role.OPERATOR, "m/poses.yaml", slow, first).status_code == 201
    other = MOTION + "dwell_s: 1.0\n"
    for version in (first, ""):  # changed since, and made since
        refused = editing.save(Role.OPERATOR, "m/poses.yaml", other, version)
        assert refusal(refused) == (412, "RID-FILE-CHANGED")
    assert editing.text("m/poses.yaml") == slow
    checked = editing.ask(Role.OPERATOR, "POST", f"m/poses.yaml?tab=a&base={first}", other).json()
    assert checked["version"] == editing.version("m/poses.yaml")
    assert checked["differences"][-2:] == ["- speed_fraction: 0.1", "+ dwell_s: 1.0"]
    assert [each.what for each in editing.service.audit.newest()] == ["changed a file"] * 2


def test_a_removed_file_is_not_made_again_silently(editing: Editing) -> None:
    editing.save(Role.OPERATOR, "poses.yaml", MOTION, "")
    version = editing.version("poses.yaml")
    (editing.folder / "poses.yaml").unlink()
    refused = editing.save(Role.OPERATOR, "poses.yaml", MOTION, version)
    assert refusal(refused) == (412, "RID-FILE-CHANGED")
    assert not (editing.folder / "poses.yaml").exists()


def test_an_invalid_file_is_not_saved_and_its_errors_have_lines(editing: Editing) -> None:
    wrong = editing.text("arm.yaml").replace("gravity_m_s2:", "gravity:")
    line = wrong[: wrong.index("gravity:")].count("\n") + 1
    answer = editing.ask(Role.ADMINISTRATOR, "POST", "arm.yaml?tab=a", wrong)
    problems = answer.json()["check"]["problems"]
    assert ("", line, "RID-FILE-VALUE") in [(p["file"], p["line"], p["code"]) for p in problems]
    before = editing.version("arm.yaml")
    refused = editing.save(Role.ADMINISTRATOR, "arm.yaml", wrong, before)
    assert refusal(refused) == (422, "RID-FILE-VALUE")
    assert editing.version("arm.yaml") == before


def test_a_file_that_does_not_fit_the_cell_needs_a_confirmation(editing: Editing) -> None:
    renamed = editing.text("arm.yaml").replace("name: axis1", "name: waist")
    check = editing.ask(Role.ADMINISTRATOR, "POST", "arm.yaml?tab=a", renamed).json()["check"]
    assert check["problems"] == []
    assert [(p["file"], p["code"]) for p in check["cell_problems"]] == [
        ("cell.yaml", "RID-CELL-JOINTS")
    ]
    version = editing.version("arm.yaml")
    refused = editing.save(Role.ADMINISTRATOR, "arm.yaml", renamed, version)
    assert refusal(refused) == (422, "RID-CELL-JOINTS")
    confirmed = {"query": "?incomplete=true"}
    saved = editing.save(Role.ADMINISTRATOR, "arm.yaml", renamed, version, **confirmed)
    assert saved.status_code == 201
    cell = editing.service.cell("ir361")
    cell.reload_if_changed()
    assert "waist" in cell.problem
    assert cell.loaded.robot.joint_names[0] == "axis1"  # the last valid content


def test_the_key_at_the_cursor_is_explained(editing: Editing) -> None:
    place = "cell.yaml?tab=a&line=1&column=1"
    text = editing.text("cell.yaml")
    line = text[: text.index("\nrobot:")].count("\n") + 2
    place = f"cell.yaml?tab=a&line={line}&column=1"
    shown = editing.ask(Role.ADMINISTRATOR, "POST", place, text).json()["check"]["place"]
    assert (shown["path"], shown["key"]["default"]) == ("robot", "required")
    assert {"robot", "axes", "home"} <= {key["name"] for key in shown["allowed"]}


def test_a_motion_of_another_robot_is_an_error_at_its_line(editing: Editing) -> None:
    other = MOTION.replace("ir361", "kr15")
    answer = editing.ask(Role.OPERATOR, "POST", "new.yaml?tab=a&cell=ir361", other).json()
    assert answer["version"] == ""
    found = answer["check"]["problems"]
    assert [(each["line"], each["code"]) for each in found] == [(1, "RID-ROBOT-OTHER")]


@pytest.mark.promise("edited-files")
def test_only_administrators_edit_the_files_of_a_cell(editing: Editing) -> None:
    text, version = editing.text("arm.yaml"), editing.version("arm.yaml")
    for role in (Role.VIEWER, Role.OPERATOR):
        assert editing.save(role, "arm.yaml", text, version).status_code == 403
        assert editing.ask(role, "POST", "arm.yaml?tab=a", text).status_code == 403


@pytest.mark.promise("edited-files")
def test_a_cell_that_another_client_holds_is_not_changed(editing: Editing) -> None:
    held = editing.service.leases.take("ir361", ANNA, "weighing", 60.0)
    text, version = editing.text("arm.yaml") + "# checked\n", editing.version("arm.yaml")
    refused = editing.save(Role.ADMINISTRATOR, "arm.yaml", text, version)
    assert refusal(refused) == (409, "RID-LEASE-OTHER")
    own = {"x_rid_daq_lease": held.key}
    assert editing.save(Role.ADMINISTRATOR, "arm.yaml", text, version, **own).status_code == 201


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("runs/a.yaml", "RID-OUTPUT-RUN"),
        ("sheet.json", "RID-FILE-TYPE"),
        ("drive.eds", "RID-FILE-TYPE"),
    ],
)
def test_other_files_are_not_edited(editing: Editing, name: str, code: str) -> None:
    answer = editing.save(Role.ADMINISTRATOR, name, MOTION, "")
    assert refusal(answer) == (422, code)


def test_a_motion_with_a_table_outside_the_folder_is_not_saved(editing: Editing) -> None:
    table = 'robot: ir361\nkind: joint_table\nfile: "../table.csv"\n'
    answer = editing.save(Role.OPERATOR, "table.yaml", table, "")
    assert refusal(answer) == (422, "RID-PATH-OUTSIDE")


def test_editors_see_each_other_until_their_pages_are_closed() -> None:
    now_s = 0.0
    editors = Editors(lambda: now_s)
    file = Path("arm.yaml")
    assert editors.note(file, "1", ANNA, has_changes=False) == ()
    (anna,) = editors.note(file, "2", BERT, has_changes=True)
    assert (anna.who, anna.has_changes) == ("Anna", False)
    assert editors.note(Path("cell.yaml"), "3", BERT, has_changes=False) == ()
    now_s = PRESENT_S - 1.0
    (bert,) = editors.note(file, "1", ANNA, has_changes=False)
    assert (bert.who, bert.has_changes) == ("Bert", True)
    now_s = PRESENT_S + 1.0
    assert editors.note(file, "1", ANNA, has_changes=False) == ()
    editors.forget(file, "1")
    assert editors.note(file, "2", BERT, has_changes=False) == ()


def test_a_cell_is_loaded_with_content_that_is_not_saved(editing: Editing) -> None:
    path = editing.folder / "arm.yaml"
    heavy = path.read_bytes().replace(b"name: ir361", b"name: another")
    loaded = load_cell(str(editing.folder / "cell.yaml"), {path.resolve(): heavy})
    assert loaded.robot.name == "another"
    assert loaded.disk_names["robot.yaml"] == path.absolute()
    assert "another" not in bundled_names("robots")


@pytest.mark.promise("edited-files")
def test_only_the_known_version_of_a_file_without_a_cell_or_run_is_deleted(
    editing: Editing,
) -> None:
    editing.ask(Role.OPERATOR, "PUT", "m/poses.yaml", MOTION)
    editing.ask(Role.OPERATOR, "PUT", "m/ahead.json", "{}")
    (editing.service.runs / "a").mkdir(parents=True)
    (editing.service.runs / "a" / "motion.yaml").write_text(MOTION)

    def delete(role: Role, name: str, version: str) -> httpx.Response:
        return editing.ask(role, "DELETE", name, if_match=f'"{version}"')

    for role, name, version, expected in (
        (Role.VIEWER, "m/poses.yaml", editing.version("m/poses.yaml"), (403, "RID-ACCESS-ROLE")),
        (Role.OPERATOR, "m/poses.yaml", "0" * 64, (412, "RID-FILE-CHANGED")),
        (Role.OPERATOR, "m/none.yaml", "0" * 64, (404, "RID-FILE-UNKNOWN")),
        (Role.ADMINISTRATOR, "arm.yaml", editing.version("arm.yaml"), (422, "RID-OUTPUT-CELL")),
        (
            Role.OPERATOR,
            "runs/a/motion.yaml",
            editing.version("runs/a/motion.yaml"),
            (422, "RID-OUTPUT-RUN"),
        ),
    ):
        assert refusal(delete(role, name, version)) == expected
    assert editing.ask(Role.OPERATOR, "DELETE", "m/poses.yaml").status_code == 422  # no version
    assert editing.text("m/poses.yaml") == MOTION
    for name in ("m/poses.yaml", "m/ahead.json"):
        assert delete(Role.OPERATOR, name, editing.version(name)).status_code == 204
    assert list((editing.folder / "m").iterdir()) == []
    assert [each.what for each in editing.service.audit.newest()][:2] == ["deleted a file"] * 2
