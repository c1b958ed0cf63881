"""During a jog and an axis test, the picture shows the positive direction of the joint that
moves.
"""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.builders.browser_drawing import wait_for_picture
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, give_back, ready, take_cell

pytestmark = pytest.mark.slow

VIEW = "document.getElementById('view').robotView"
SHOWN = f"{VIEW}.drawing.turns.map((each) => each.visible)"
ARMS = f"(() => {{ const {{ position, target }} = {VIEW}.drawing; return [position, target]; }})()"


def begin(page: Page, button: str) -> None:
    page.locator(button).click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()
    expect(page.locator("#job .hold").first).to_be_visible()


def require_shown(page: Page, shown: list[bool]) -> None:
    for _ in range(300):
        if page.evaluate(SHOWN) == shown:
            return
        page.wait_for_timeout(100)
    assert page.evaluate(SHOWN) == shown


def require_rest(page: Page) -> None:
    """Wait until the shown pose no longer moves: the arm settles after its drives are enabled."""
    before, _ = page.evaluate(ARMS)
    for _ in range(300):
        page.wait_for_timeout(300)
        last, (before, _) = before, page.evaluate(ARMS)
        if np.degrees(np.subtract(before, last)) == pytest.approx([0.0, 0.0, 0.0], abs=0.01):
            return
    pytest.fail("the arm does not come to rest")


def test_a_jog_shows_the_chosen_joint_and_a_ghost_that_stays(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    wait_for_picture(page)
    take_cell(page)
    ready(page, served_pages)
    begin(page, "#jog")
    require_shown(page, [True, False, False])
    require_rest(page)
    page.locator(".joint", has_text="axis2").click()
    require_shown(page, [False, True, False])
    ahead = pytest.approx([0.0, 2.0, 0.0], abs=0.05)
    for _ in range(100):  # the shown pose first follows the arm
        before, ghost = page.evaluate(ARMS)
        if np.degrees(np.subtract(ghost, before)) == ahead:
            break
        page.wait_for_timeout(100)
    assert np.degrees(np.subtract(ghost, before)) == ahead

    plus = page.get_by_role("button", name="positive direction", exact=False).last
    plus.dispatch_event("pointerdown", {"button": 0, "pointerId": 1})
    for _ in range(600):
        moved, stays = page.evaluate(ARMS)
        if moved[1] > before[1] + 1e-3:
            break
        page.wait_for_timeout(50)
    plus.dispatch_event("pointerup", {"button": 0, "pointerId": 1})
    assert moved[1] > before[1]
    assert stays == ghost
    page.get_by_role("button", name="Finish").click()
    expect(page.locator("#job .verdict.end")).to_be_visible()
    require_shown(page, [False, False, False])
    give_back(page)


def test_an_axis_test_shows_the_axis_without_a_ghost(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    page = open_page()
    wait_for_picture(page)
    take_cell(page)
    ready(page, served_pages)
    begin(page, "#axes")
    require_shown(page, [True, False, False])
    assert page.evaluate(ARMS)[1] is None
    page.get_by_role("button", name="Finish").click()
    expect(page.locator("#job .verdict.end")).to_be_visible()
    require_shown(page, [False, False, False])
    give_back(page)
