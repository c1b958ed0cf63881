"""The 3-D view on the page of a cell: live and old poses, keys, a lost context, no WebGL."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.builders.browser_drawing import (
    changed_share,
    picture_of,
    wait_for_picture,
    wait_until_drawn,
)
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage
from tests.rid_daq.workbench.stopped_motion import moving
from tests.rid_daq.workbench.test_every_page import CUT_OFF, WIDTHS, require_axe

pytestmark = pytest.mark.slow

VIEW = "document.getElementById('view').robotView"
FRAMES = f"{VIEW}.drawing.frames"
MOST_KB = 300.0
TRIANGLES_KB = 85.0
"""Compressed size of 10,000 triangles, as `benchmarks.view3d` sends them."""

TRANSFERRED_KB = r"""() => Object.values(Object.fromEntries(performance.getEntries()
  .filter((each) => !/\/triangles\/|login\.js|\/(\?t=[^\/]*)?$/.test(each.name))
  .map(({ name, entryType, transferSize }) => [entryType + name, transferSize ?? 0])))
  .reduce((sum, size) => sum + size, 0) / 1000"""
"""Return the transferred kilobytes, without triangles and without the page of the login.

Repeated requests of an address, such as that of the state of the cell, count once.
"""

NO_WEBGL = "HTMLCanvasElement.prototype.getContext = () => null"


def positions(page: Page) -> list[float]:
    """Return the positions in the joint table [°]."""
    cells = page.locator("#view tbody td.number:not(.soft)").all_inner_texts()
    return [float(text.split()[0]) for text in cells]


def test_the_pose_is_live_during_a_motion_and_old_before_and_after(
    open_page: OpenPage, served_pages: ServedProcess, program_lease: str
) -> None:
    page = open_page()
    wait_for_picture(page)
    state = page.locator("#view .view-state")
    expect(state).to_contain_text("NO LIVE DATA: pose of the preflight")
    before = positions(page)
    with moving(served_pages, program_lease):
        expect(state).to_have_text("LIVE: measured pose")
        expect(page.locator("#view tbody")).not_to_contain_text(f"{before[0]:.1f} °")
    expect(state).to_contain_text("NO LIVE DATA: last measured pose")
    page.wait_for_timeout(300)  # the last update of the table
    after = positions(page)
    assert after != before
    drawn = page.evaluate(f"{VIEW}.drawing.position")
    assert np.degrees(drawn) == pytest.approx(after, abs=0.051)


@pytest.mark.usefixtures("program_lease")  # of a checked cell, so that the page loads its lines
def test_the_first_visit_of_a_page_with_10000_triangles_transfers_little(
    open_page: OpenPage,
) -> None:
    page = open_page()
    wait_for_picture(page)
    page.wait_for_load_state("networkidle")
    assert page.evaluate(TRANSFERRED_KB) + TRIANGLES_KB < MOST_KB


def test_a_still_scene_is_not_drawn_again(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_picture(page)
    page.wait_for_timeout(500)  # a font or a style may still change the size
    wait_until_drawn(page)
    drawn = page.evaluate(FRAMES)
    page.wait_for_timeout(1500)
    assert page.evaluate(FRAMES) == drawn


def test_keys_turn_and_zoom_the_picture_and_the_wheel_scrolls_the_page(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_picture(page)
    canvas = page.locator("#view canvas").first
    canvas.hover()
    page.mouse.wheel(0, 200)
    page.wait_for_timeout(300)
    assert page.evaluate("scrollY") > 0
    canvas.scroll_into_view_if_needed()
    canvas.focus()
    page.keyboard.press("Home")  # the keys also show the outline of the focus
    wait_until_drawn(page)
    before = picture_of(page)
    page.keyboard.press("ArrowLeft")
    wait_until_drawn(page)
    turned = picture_of(page)
    assert changed_share(before, turned) > 0.01
    page.keyboard.press("+")
    wait_until_drawn(page)
    assert changed_share(turned, picture_of(page)) > 0.01
    scrolled = page.evaluate("scrollY")
    page.keyboard.press("ArrowDown")
    assert page.evaluate("scrollY") == scrolled
    page.keyboard.press("Home")
    wait_until_drawn(page)
    assert changed_share(before, picture_of(page)) == 0.0


def test_the_positive_direction_of_a_joint_can_be_shown(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_picture(page)
    button = page.get_by_role("button", name="Show axis2 +2°")
    before = picture_of(page)
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    wait_until_drawn(page)
    assert changed_share(before, picture_of(page)) > 0.002
    ghost, real = page.evaluate(
        f"(() => {{ const {{ ghost, arm }} = {VIEW}.drawing;"
        " return [ghost, arm].map((each) => each.links[2].matrixWorld.toArray()); })()"
    )
    turn = np.array(real).reshape(4, 4).T[:3, :3].T @ np.array(ghost).reshape(4, 4).T[:3, :3]
    assert turn[1, 0] == pytest.approx(np.sin(np.radians(2.0)))  # about +z of the joint
    button.click()
    wait_until_drawn(page)
    assert changed_share(before, picture_of(page)) < 0.005


def test_a_lost_graphics_context_is_reported_and_comes_back(open_page: OpenPage) -> None:
    page = open_page()
    wait_for_picture(page)
    problem = page.locator("#view .view-problem")
    expect(problem).to_be_hidden()
    page.evaluate(
        f"window.lost = {VIEW}.drawing.renderer.getContext().getExtension('WEBGL_lose_context');"
        "window.lost.loseContext()"
    )
    expect(problem).to_contain_text("The robot is not affected")
    page.evaluate("window.lost.restoreContext()")
    expect(problem).to_be_hidden()
    frames = page.evaluate(FRAMES)
    page.locator("#view canvas").first.focus()
    page.keyboard.press("ArrowLeft")
    wait_until_drawn(page)
    assert page.evaluate(FRAMES) > frames


def test_without_webgl_the_table_shows_the_pose(open_page: OpenPage) -> None:
    page = open_page()
    page.add_init_script(NO_WEBGL)
    page.reload()
    expect(page.locator("#view .view-problem")).to_contain_text("no WebGL 2")
    expect(page.locator("#view tbody tr")).to_have_count(3)
    expect(page.locator("#view tbody td.number").first).to_have_text(re.compile("°|unknown"))
    loaded = page.evaluate("performance.getEntriesByType('resource').map((each) => each.name)")
    assert [name for name in loaded if name.endswith("three.js") or "/triangles/" in name] == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_view_is_accessible_and_fits_all_widths(
    open_page: OpenPage, screenshots: Path, dark: bool
) -> None:
    page = open_page(dark=dark)
    wait_for_picture(page)
    page.locator("#view details").evaluate("part => { part.open = true }")
    require_axe(page)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(300)
        assert not page.evaluate(CUT_OFF)
        name = f"cell-3d-{width}-{'dark' if dark else 'light'}.png"
        page.screenshot(path=screenshots / name, full_page=True)
