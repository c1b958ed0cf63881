"""View of a planned motion: another file, a file that is refused, a live pose, the approach."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, Route, expect

from tests.builders.browser_drawing import wait_for_picture
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage
from tests.rid_daq.workbench.stopped_motion import moving

pytestmark = pytest.mark.slow

VIEW = "document.getElementById('view').robotView"
PATH_LENGTH = f"{VIEW}.path.length"
TOO_FAR = "kind: joint_table\nrobot: ir361\njoints: [axis1, axis2, axis3]\ntime_s: [0, 1, 2]\n"
TOO_FAR += "position: [[0, 0, 0], [9, 0, 0], [0, 0, 0]]\n"


@pytest.fixture
def page(open_page: OpenPage, served_pages: ServedProcess, long_motion: str) -> Page:
    """Open the page Experiment, on which a motion is shown."""
    (served_pages.folder / "long.yaml").write_text(long_motion)
    (served_pages.folder / "other.yaml").write_text(long_motion)
    (served_pages.folder / "too-far.yaml").write_text(TOO_FAR)
    page = open_page()
    page.goto(served_pages.url.split("/?")[0] + "/cells/ir361/experiment?motion=long.yaml")
    wait_for_picture(page)
    expect(page.locator("#view .player")).to_be_visible()
    return page


def test_a_motion_that_is_refused_hides_the_earlier_one(page: Page, problems: list[str]) -> None:
    assert page.evaluate(PATH_LENGTH) > 0
    page.locator("#motion").select_option("too-far.yaml")
    expect(page.locator("#view .clearance")).to_contain_text("axis1")
    expect(page.locator("#view .player")).to_be_hidden()
    expect(page.locator("#view .view-state")).not_to_contain_text("PLANNED")
    assert page.evaluate(PATH_LENGTH) == 0
    page.locator("#motion").select_option("long.yaml")
    expect(page.locator("#view .player")).to_be_visible()
    problems.clear()  # the browser reports the refusal


def test_the_earlier_motion_is_hidden_while_another_one_is_computed(page: Page) -> None:
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route(re.compile("/view/cells/ir361/motion"), hold)
    page.locator("#motion").select_option("other.yaml")
    expect(page.locator("#view .player")).to_be_hidden()
    expect(page.locator("#view .view-state")).not_to_contain_text("PLANNED")
    for _ in range(300):
        if held:
            break
        page.wait_for_timeout(100)
    held[0].continue_()
    expect(page.locator("#view .player")).to_be_visible()


def test_a_live_pose_replaces_the_planned_one_and_the_approach_begins_at_the_last_pose(
    page: Page, served_pages: ServedProcess, program_lease: str
) -> None:
    state = page.locator("#view .view-state")
    expect(state).to_contain_text("PLANNED MOTION")
    with moving(served_pages, program_lease):
        expect(state).to_have_text("LIVE: measured pose")
        expect(page.locator("#view .player")).to_be_hidden()
        expect(page.locator("#view .clearance")).to_be_hidden()
    expect(state).to_contain_text("PLANNED MOTION, NO LIVE DATA: approach.")
    expect(page.locator("#view .player")).to_be_visible()
    expect(page.locator("#view .player .soft")).to_contain_text("the pose of the preflight")
    assert float(page.locator("#view .player input").get_attribute("min") or 0.0) < 0.0
