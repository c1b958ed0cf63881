"""A cell's files and motions edited in a browser, by one person and by two."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.editing import write_cell
from tests.rid_daq.service.test_file_edits import MOTION
from tests.rid_daq.workbench.conftest import OpenPage

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served_pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedProcess]:
    """Run a service of a cell whose files are in the service's folder."""
    folder = tmp_path_factory.mktemp("edited")
    write_cell(folder)
    with serving(folder, cell=str(folder / "cell.yaml")) as running:
        yield running


Edit = Callable[[str], Page]


@pytest.fixture
def edit(open_page: OpenPage, served_pages: ServedProcess) -> Edit:
    """Return a function that opens a file in a new browser profile."""

    def opened(name: str) -> Page:
        page = open_page()
        page.goto(f"{served_pages.url.split('/?')[0]}/cells/ir361/edit/{name}")
        expect(page.locator("#state-words")).not_to_be_empty()
        return page

    return opened


def replace(page: Page, old: str, new: str) -> None:
    """Replace a part of the text in the editor."""
    text = page.locator("#text").input_value()
    assert old in text
    page.locator("#text").fill(text.replace(old, new))


def test_the_friction_page_leads_to_the_robot_file(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    page.goto(f"{served_pages.url.split('/?')[0]}/cells/ir361/friction")
    page.locator("#result-card").evaluate("card => { card.hidden = false }")
    page.get_by_role("link", name="Edit the robot file").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("arm.yaml")


def test_errors_are_shown_at_their_line_and_prevent_saving(
    edit: Edit, served_pages: ServedProcess
) -> None:
    page = edit("arm.yaml")
    text = page.locator("#text").input_value()
    assert text == (served_pages.folder / "arm.yaml").read_text()
    line = text[: text.index("gravity_m_s2")].count("\n") + 1
    replace(page, "gravity_m_s2", "gravity")
    jump = page.locator("#problems").get_by_role("button", name=f"Line {line}", exact=True)
    expect(jump).to_be_visible()
    expect(page.locator("#lines .wrong").first).to_have_text(f"✗ {line}")
    expect(page.locator("#save")).to_be_disabled()
    jump.click()
    at = page.evaluate("document.activeElement.selectionStart")
    assert page.locator("#text").input_value()[at:].startswith("gravity")
    replace(page, "gravity:", "gravity_m_s2:")
    expect(page.locator("#problems li")).to_have_count(0)
    expect(page.locator("#state-words")).to_have_text("Saved.")


def test_the_key_at_the_cursor_is_explained(edit: Edit) -> None:
    page = edit("cell.yaml")
    place = page.locator("#text").input_value().index("cycle_time_ms")
    page.locator("#text").evaluate("(text, at) => text.setSelectionRange(at, at)", place)
    page.locator("#text").press("ArrowRight")
    expect(page.locator("#place b")).to_contain_text("cycle_time_ms")
    page.locator("#place summary").click()
    expect(page.locator("#place dt", has_text="drive_safety")).to_be_visible()


def test_two_people_are_told_of_each_other_and_nothing_is_overwritten(
    edit: Edit, served_pages: ServedProcess
) -> None:
    (served_pages.folder / "shared.yaml").write_text(MOTION)
    anna, bert = edit("shared.yaml"), edit("shared.yaml")
    expect(anna.locator("#others")).to_contain_text("has had this file open")
    replace(anna, "0.2, 0.1, 0.1", "0.3, 0.1, 0.1")
    expect(bert.locator("#others")).to_contain_text("with changes that are not saved")
    replace(bert, "0.2, 0.1, 0.1", "0.4, 0.1, 0.1")
    expect(anna.locator("#save")).to_be_enabled()
    anna.locator("#save").click()
    expect(anna.locator("#saved")).to_contain_text("Saved")
    expect(bert.locator("#conflict")).to_be_visible()
    expect(bert.locator("#save")).to_be_disabled()
    expect(bert.locator("#versions pre")).to_contain_text("- - [0.3, 0.1, 0.1]")
    assert "0.3, 0.1, 0.1" in (served_pages.folder / "shared.yaml").read_text()
    bert.get_by_role("button", name="Use the file").click()
    expect(bert.locator("#text")).to_have_value(MOTION.replace("0.2, 0.1", "0.3, 0.1"))
    replace(bert, "0.3, 0.1, 0.1", "0.5, 0.1, 0.1")
    expect(bert.locator("#save")).to_be_enabled()
    bert.locator("#save").click()
    expect(anna.locator("#conflict")).to_be_visible()
    replace(anna, "0.3, 0.1, 0.1", "0.6, 0.1, 0.1")
    anna.get_by_role("button", name="Save my text").click()
    expect(anna.locator("#saved")).to_contain_text("Saved")
    assert "0.6, 0.1, 0.1" in (served_pages.folder / "shared.yaml").read_text()


def test_a_text_that_is_not_saved_survives_a_change_of_page_with_its_version(
    edit: Edit, served_pages: ServedProcess
) -> None:
    file = served_pages.folder / "draft.yaml"
    file.write_text(MOTION)
    page = edit("draft.yaml")
    replace(page, "0.2, 0.1, 0.1", "0.3, 0.1, 0.1")
    page.get_by_role("link", name="Runs", exact=True).click()
    file.write_text(MOTION.replace("0.2", "0.25"))
    page.go_back()
    expect(page.locator("#text")).to_have_value(MOTION.replace("0.2, 0.1", "0.3, 0.1"))
    expect(page.locator("#conflict")).to_be_visible()
    expect(page.locator("#save")).to_be_disabled()


def test_a_file_that_does_not_fit_the_cell_needs_a_confirmation(
    edit: Edit, served_pages: ServedProcess
) -> None:
    page = edit("arm.yaml")
    replace(page, "name: axis1", "name: waist")
    expect(page.locator("#problems li")).to_contain_text("waist")
    page.locator("#save").click()
    expect(page.get_by_role("dialog")).to_contain_text("waist")
    page.keyboard.press("Escape")
    assert "waist" not in (served_pages.folder / "arm.yaml").read_text()
    page.locator("#save").click()
    page.get_by_role("button", name="Save it nevertheless").click()
    expect(page.locator("#saved")).to_contain_text("Saved")
    assert "waist" in (served_pages.folder / "arm.yaml").read_text()
    replace(page, "name: waist", "name: axis1")
    expect(page.locator("#problems li")).to_have_count(0)
    page.locator("#save").click()
    expect(page.locator("#saved")).to_contain_text("Saved")
    assert load_cell(str(served_pages.folder / "cell.yaml")).robot.joint_names[0] == "axis1"


def test_the_settings_lead_to_the_files_of_the_cell(edit: Edit) -> None:
    page = edit("cell.yaml")
    page.get_by_role("link", name="Settings", exact=True).click()
    page.locator("summary", has_text="arm.yaml").click()
    page.get_by_role("link", name="Edit arm.yaml").click()
    expect(page.locator("h1")).to_have_text("arm.yaml")


def test_a_motion_is_made_by_clicks_and_seen_before_it_is_saved(
    edit: Edit, served_pages: ServedProcess
) -> None:
    page = edit("cell.yaml")
    page.get_by_role("link", name="Experiment", exact=True).click()
    page.locator("summary", has_text="with sliders").click()
    page.locator("#click-name").fill("clicked")
    page.get_by_role("button", name="Choose the poses").click()
    expect(page.locator("h1")).to_have_text("clicked.yaml")
    page.locator("#pose-add").click()
    page.locator("#pose-0").fill("20,5")  # with a decimal comma
    page.locator("#pose-0").press("Tab")
    expect(page.locator(".view-parts tbody tr").first).to_contain_text("20.5 °")
    refused = page.locator("p.clearance.problem")  # one pose is no motion yet
    expect(refused).to_be_visible()
    refused.evaluate("place => place.replaceChildren()")
    page.get_by_role("button", name="Replace pose 1").click()
    expect(refused).not_to_be_empty()  # the new text is refused too
    expect(page.locator(".view-parts tbody tr").first).to_contain_text("20.5 °")
    page.locator("#pose-0").fill("-10")
    page.locator("#pose-0").press("Tab")
    page.locator("#pose-1").fill("99")
    page.locator("#pose-1").press("Tab")
    expect(page.locator("#pose-1-problem")).to_contain_text("-80 to 57")
    page.locator("#pose-add").click()
    expect(page.locator("#pose-list li")).to_have_count(2)
    expect(page.locator(".view-state")).to_contain_text("PLANNED")
    assert not (served_pages.folder / "clicked.yaml").exists()
    page.locator("#pose-kind").select_option("path")
    expect(page.locator("#text")).to_have_value(re.compile("start_m"))
    page.get_by_role("button", name="Earlier pose 2").click()
    expect(page.locator("#pose-list li").first).to_contain_text("-10.0 °")
    expect(page.locator("#save")).to_be_enabled()
    page.locator("#save").click()
    page.get_by_role("link", name="Record this motion").click()
    expect(page.locator("#motion")).to_have_value("clicked.yaml")
    page.get_by_role("link", name="Edit this motion").click()
    expect(page.locator("#pose-kind")).to_have_value("path")
    expect(page.locator("#pose-list li").first).to_contain_text("-10.0 °")


def test_a_circle_is_made_by_clicks(
    edit: Edit, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = edit("turns.yaml")
    page.locator("#pose-add").click()
    page.locator("#pose-kind").select_option("circle")
    expect(page.locator("#pose-hint")).to_contain_text("centre")
    page.locator("#pose-radius_m").fill("40,5")
    page.locator("#pose-radius_m").press("Tab")
    page.locator("#pose-normal").select_option("vertical: y and z of the base")
    page.locator("#pose-periods").fill("3")
    page.locator("#pose-periods").press("Tab")
    page.locator("#pose-add").click()
    expect(page.locator("#pose-problem")).to_contain_text("2 poses")
    problems.clear()  # the console reports the refused request
    page.get_by_role("button", name="Remove pose 2").click()
    expect(page.locator("#pose-problem")).to_be_empty()
    expect(page.locator(".view-state")).to_contain_text("PLANNED")
    page.locator("#save").click()
    expect(page.locator("#saved")).to_contain_text("Saved")
    saved = load_motion(served_pages.folder / "turns.yaml")
    assert isinstance(saved, CircleMotion)
    assert (saved.radius_m, saved.normal, saved.periods) == (0.0405, (1.0, 0.0, 0.0), 3)
    page.reload()
    expect(page.locator("#pose-radius_m")).to_have_value("40.5")
    expect(page.locator("#pose-normal option:checked")).to_contain_text("y and z")
