"""The pages as a new user operates them: to a validated model and to a payload."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import OpenPage, checked, give_back, take_cell
from tests.rid_daq.workbench.test_every_page import WIDTHS, require_axe

pytestmark = pytest.mark.slow

SHOWN_FIGURE = "[data-figure-state=shown]"
LONG_MS = 400_000  # a motion on a busy computer


@pytest.fixture(scope="module")
def served_arm(
    tmp_path_factory: pytest.TempPathFactory, six_axis_motion: Callable[[int], Path]
) -> Iterator[ServedProcess]:
    """Run a service of the bundled six-axis cell with a short motion."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "six.yaml").write_bytes(six_axis_motion(3).read_bytes())
    with serving(folder, cell="kr15") as running:
        yield running


def go_to(page: Page, title: str) -> None:
    page.get_by_role("navigation").get_by_role("link", name=title, exact=True).click()
    expect(page.get_by_role("heading", level=1)).to_have_text(title)


def begin_motion(page: Page, button: str) -> None:
    """Press a button that moves the robot, and confirm that the cell is clear."""
    page.locator(button).click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()


REPEATED = """() => {
  const texts = (id) => document.getElementById(id).innerText.split("\\n");
  const lines = (id) => texts(id).map((each) => each.trim());
  const below = new Set(lines("stage-result").filter((each) => each.length > 20)); // no button
  return lines("job").filter((each) => below.has(each));
}"""
"""Sentences of the job's card that are repeated in the result below it."""


def pictured(page: Page, screenshots: Path, name: str) -> None:
    """Store pictures of a page, and check its accessibility (axe) in both themes."""
    for colours in ("light", "dark"):
        page.emulate_media(color_scheme="dark" if colours == "dark" else "light")
        expect(page.locator("[data-figure-state=loading]")).to_have_count(0)
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            page.screenshot(path=screenshots / f"{name}-{width}-{colours}.png", full_page=True)
        require_axe(page)
    page.emulate_media(color_scheme="light")


def test_a_new_user_gets_from_an_experiment_to_a_validated_model(
    open_page: OpenPage, screenshots: Path
) -> None:
    page = open_page()
    take_cell(page)
    go_to(page, "Identify")
    expect(page.locator("#solve")).to_be_disabled()
    expect(page.locator("#solve-why")).to_have_text("Data are missing: choose a run.")
    go_to(page, "Experiment")
    expect(page.locator("#rehearse")).to_be_disabled()
    checked(page)

    page.locator("#design").evaluate("part => { part.open = true }")
    page.locator("#period").fill("2.4")
    page.locator("#periods").fill("3")
    page.locator("#design-go").click()
    expect(page.locator("#picture")).to_contain_text("Condition number")
    expect(page.locator("#motion")).to_have_value("excitation.yaml")
    page.locator("#picture > [data-figure=motion]").scroll_into_view_if_needed()
    expect(page.locator(f"#picture > [data-figure=motion]{SHOWN_FIGURE}")).to_be_visible()

    page.locator("#label").fill("other")
    begin_motion(page, "#record")
    expect(page.locator("#job .verdict.end")).to_have_text("Record: done", timeout=LONG_MS)
    page.locator("#label").fill("first")
    page.locator("#until").fill("torque<1000Nm")
    begin_motion(page, "#rehearse")
    expect(page.locator("#job .estimate")).to_contain_text("torque")
    identify = page.locator("#job").get_by_role("link", name="Identify this run")
    expect(identify).to_have_count(0)
    expect(identify).to_be_visible(timeout=LONG_MS)
    expect(page.locator("#job")).to_contain_text("Rehearsal")
    expect(page.locator("#job")).to_contain_text("torque<1000Nm")
    pictured(page, screenshots, "experiment-recorded")

    identify.click()
    expect(page.locator("#check-findings .good")).to_contain_text("condition number")
    page.locator("#solve").click()
    expect(page.locator("#result .verdict.good")).to_contain_text("✓", timeout=LONG_MS)
    expect(page.locator("#result td", has_text=re.compile("^good$"))).to_have_count(3)
    for figure in ("fit", "residual_spectrum"):
        page.locator(f"[data-figure={figure}]").scroll_into_view_if_needed()
        expect(page.locator(f"[data-figure={figure}] {SHOWN_FIGURE}").first).to_be_visible()

    assert page.evaluate(REPEATED) == []
    page.locator("#other").select_option(
        page.locator("#other option", has_text="other,").first.get_attribute("value")
    )
    page.locator("#validate").click()
    expect(page.locator("#validation .verdict").first).to_contain_text("Passed")
    assert page.evaluate(REPEATED) == []
    page.locator("#export").click()
    with page.expect_download() as saved:
        page.get_by_role("link", name="Save robot.urdf").click()
    assert b"<robot" in Path(saved.value.path()).read_bytes()
    pictured(page, screenshots, "identify-validated")

    page.locator(
        "input[name=friction][value=terms]"
    ).check()  # now the inputs differ from those of the result
    expect(page.locator("[data-stage=solve]")).to_contain_text("not yet")
    give_back(page)


@pytest.mark.long
def test_a_new_user_gets_to_a_payload_verdict(
    open_page: OpenPage, served_arm: ServedProcess, screenshots: Path
) -> None:
    page = open_page(known=False, width=820)
    page.goto(served_arm.url)
    take_cell(page)
    go_to(page, "Payload")
    checked(page)
    page.locator("#motion").select_option("six.yaml")
    fill_session(page)
    begin_motion(page, "#begin")
    expect(page.locator("[data-stage=warm_up_without]")).to_contain_text("now", timeout=LONG_MS)
    page.locator("#stop").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Payload session: stopped")

    page.reload()
    checked(page)
    page.locator(".resume").click()
    expect(page.locator("#payload")).to_have_value("medium")
    expect(page.locator("#centre-limit")).to_have_value("30")
    begin_motion(page, "#begin")
    expect(page.locator("#job")).to_contain_text("continues; completed steps: rehearsal.")
    page.locator("#warm-up").scroll_into_view_if_needed(timeout=LONG_MS)
    expect(page.locator(f"#warm-figure > {SHOWN_FIGURE}")).to_be_visible(timeout=LONG_MS)
    expect(page.locator("#result .verdict").first).to_contain_text(
        "✓ Passed: the payload's mass is 9.", timeout=LONG_MS
    )
    page.locator("[data-figure=payload]").scroll_into_view_if_needed()
    expect(page.locator(f"[data-figure=payload] {SHOWN_FIGURE}").first).to_be_visible()

    page.locator("#by").fill("A. Newcomer")
    page.locator("#certify").click()
    with page.expect_download() as saved:
        page.get_by_role("link", name="Save the certificate").click()
    assert Path(saved.value.path()).read_bytes().startswith(b"<!DOCTYPE html>")

    page.locator("#export").click()
    load_data = page.locator("#load-data pre")
    expect(load_data).to_contain_text("LOAD_DATA[1]")
    held = load_data.inner_text()
    page.locator("#typed").fill(held)
    page.locator("#read-back").click()
    expect(page.locator("#compared .verdict")).to_contain_text("✓ Passed")
    page.locator("#typed").fill(held.replace("M 9.", "M 8."))
    page.locator("#read-back").click()
    expect(page.locator("#compared .verdict")).to_contain_text("✗ Failed")
    expect(page.locator("[data-figure=warm_up]")).to_have_count(1)
    pictured(page, screenshots, "payload-result")
    give_back(page)


def fill_session(page: Page) -> None:
    """Choose a short session with the payload that the plant file calls medium."""
    page.locator("#payload").select_option("medium")
    page.get_by_text("Required accuracy, number of runs").click()
    numbers = {"centre-limit": "30", "rehearsal": "60", "warm": "50", "warm-periods": "4"}
    for field, number in numbers.items():
        page.locator(f"#{field}").fill(number)
