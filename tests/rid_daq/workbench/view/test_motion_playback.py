"""A planned motion: its poses and clearances, and its playback on the page Experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from acquisition.motion.motion_file import load_motion
from config.load import load_cell
from dynamics.geometry.clearances import Clearances
from rid_daq.workbench.view.motion_playback import MOST_POSES, motion_playback
from tests.builders.browser_drawing import changed_share, picture_of, wait_for_picture
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import OpenPage
from tests.rid_daq.workbench.test_every_page import CUT_OFF, WIDTHS, require_axe

CLOCK = "#view .player output"


@pytest.fixture(scope="module")
def six(six_axis_motion: Callable[[int], Path]) -> Path:
    return six_axis_motion(3)


@pytest.fixture(scope="module")
def served_pages(tmp_path_factory: pytest.TempPathFactory, six: Path) -> Iterator[ServedProcess]:
    """Run a service of the bundled six-axis cell with a short motion."""
    folder = tmp_path_factory.mktemp("planned")
    (folder / "six.yaml").write_bytes(six.read_bytes())
    with serving(folder, cell="kr15") as running:
        yield running


def test_the_poses_are_those_of_the_motion_and_have_their_clearances(six: Path) -> None:
    cell = load_cell("kr15")
    found = motion_playback(cell, six)
    whole = load_motion(six).plan(cell.robot, cell.config.cycle_time_s)
    assert len(found.times_s) <= MOST_POSES
    assert found.periods == whole.periods == 3
    one = whole.whole(1)
    rows = (found.times_s / one.sample_period_s).round().astype(int)
    assert rows[0] == 0
    assert rows[-1] == len(one.position) - 1
    np.testing.assert_array_equal(found.position, one.position[rows])
    assert {"run-in", "main part", "run-out"} <= set(found.phases)

    clearances = Clearances.of(cell.robot, cell.config.workspace)
    assert found.clearance_m is not None
    for row in (0, len(rows) // 2, int(found.clearance_m.argmin())):
        nearest = clearances.nearest(found.position[row : row + 1])
        assert found.clearance_m[row] == pytest.approx(nearest.min())
        assert found.pairs[row] == clearances.names[int(nearest.argmin())]


def test_a_robot_without_bodies_has_no_clearance(motion: str, tmp_path: Path) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(motion)
    assert motion_playback(load_cell("ir361"), path).clearance_m is None


@pytest.mark.slow
def test_a_motion_is_played_and_can_be_scrubbed(
    open_page: OpenPage, served_pages: ServedProcess, six: Path, screenshots: Path
) -> None:
    page = open_page()
    page.goto(served_pages.url.split("/?")[0] + "/cells/kr15/experiment")
    wait_for_picture(page)
    expect(page.locator("#view .view-state")).to_contain_text("PLANNED MOTION, NO LIVE DATA")
    found = motion_playback(load_cell("kr15"), six)
    end_s = found.times_s[-1]
    expect(page.locator(CLOCK)).to_contain_text(f"0.0 of {end_s:.1f} s")

    before = picture_of(page)
    row = int(np.abs(found.position - found.position[0]).max(axis=1).argmax())
    page.locator("#view .player input").fill(str(found.times_s[row]))
    page.wait_for_timeout(400)  # the table changes five times a second
    assert changed_share(before, picture_of(page)) > 0.01
    shown = page.locator("#view tbody td.number:not(.soft)").all_inner_texts()
    assert [float(text.split()[0]) for text in shown] == pytest.approx(
        np.degrees(found.position[row]), abs=0.051
    )
    assert found.clearance_m is not None
    least = int(found.clearance_m.argmin())
    expect(page.locator("#view .clearance")).to_contain_text(
        f"{1e3 * found.clearance_m[least]:.0f} mm between {found.pairs[least]}"
    )

    page.locator("#view .player input").fill(str(end_s - 0.5))
    frames = page.evaluate("document.getElementById('view').robotView.drawing.frames")
    page.locator("#view .player button").click()
    expect(page.locator(CLOCK)).to_contain_text(f"{end_s:.1f} of {end_s:.1f} s")
    expect(page.locator("#view .player button")).to_have_text("Play")  # it has ended
    assert page.evaluate("document.getElementById('view').robotView.drawing.frames") > frames

    require_axe(page)
    for dark in (False, True):
        page.emulate_media(color_scheme="dark" if dark else "light")
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            page.wait_for_timeout(300)
            assert not page.evaluate(CUT_OFF)
            name = f"experiment-3d-{width}-{'dark' if dark else 'light'}.png"
            page.screenshot(path=screenshots / name, full_page=True)
