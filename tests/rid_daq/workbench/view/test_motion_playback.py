"""A planned motion: its poses and clearances, and its playback on the page Experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from playwright.sync_api import expect

from acquisition.motion.approach import approach
from acquisition.motion.motion_file import load_motion
from acquisition.motion.samples import MotionSamples, Phase
from config.load import LoadedCell, load_cell
from dynamics.geometry.clearances import Clearances
from rid_daq.workbench.view.motion_playback import (
    MOST_POSES,
    MotionPlayback,
    motion_playback,
)
from rid_daq.workbench.view.resting_pose import RestingPose
from tests.builders.browser_drawing import (
    changed_share,
    picture_of,
    wait_for_picture,
    wait_until_drawn,
)
from tests.builders.javascript_types import assert_declared
from tests.rid_daq.robot_view.test_scene import pinocchio_of
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import OpenPage
from tests.rid_daq.workbench.test_every_page import CUT_OFF, WIDTHS, require_axe

KR15 = load_cell("kr15")
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


def plan(path: Path, cell: LoadedCell = KR15) -> MotionSamples:
    """Return all samples of one period."""
    return load_motion(path).plan(cell.robot, cell.config.cycle_time_s).whole(1)


def largest_deviation(found: MotionPlayback, samples: MotionSamples) -> float:
    """Return the largest difference of a joint from the straight lines between the poses [rad]."""
    times_s = np.arange(len(samples.position)) * samples.sample_period_s
    lines = [np.interp(times_s, found.times_s, joint) for joint in found.position.T]
    return float(np.abs(samples.position - np.column_stack(lines)).max())


def write_table(path: Path, times_s: np.ndarray, position: np.ndarray) -> Path:
    """Write a motion of the six-axis robot through joint positions [rad], (samples, 6)."""
    names = ",".join(("time_s", *KR15.robot.joint_names))
    rows = np.column_stack([times_s, position])
    np.savetxt(path.with_suffix(".csv"), rows, delimiter=",", header=names, comments="")
    path.write_text(f"kind: joint_table\nrobot: kr15\nfile: {path.stem}.csv\n")
    return path


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a motion of one minute in which two joints oscillate fast."""
    times_s = np.linspace(0.0, 60.0, 601)
    position = np.zeros((len(times_s), 6))
    rise = np.sin(np.pi * times_s / 60.0) ** 2
    position[:, 3] = 0.4 * rise * np.sin(2.0 * np.pi * 1.0 * times_s)
    position[:, 5] = 0.5 * rise * np.sin(2.0 * np.pi * 1.3 * times_s)
    return write_table(tmp_path_factory.mktemp("fast") / "fast.yaml", times_s, position)


@pytest.fixture(scope="module")
def near_miss(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a motion of two minutes that comes close to a body for one second."""
    times_s = np.linspace(0.0, 120.0, 481)
    position = np.zeros((len(times_s), 6))
    position[:, 1:3] = np.exp(-((times_s - 60.15) ** 2))[:, np.newaxis] * (0.8, -2.0)
    return write_table(tmp_path_factory.mktemp("near") / "near.yaml", times_s, position)


@pytest.fixture(scope="module")
def six_shown(six: Path) -> MotionPlayback:
    return motion_playback(KR15, load_motion(six), RestingPose())


@pytest.fixture(scope="module")
def fast_shown(fast: Path) -> MotionPlayback:
    return motion_playback(KR15, load_motion(fast), RestingPose())


def test_the_poses_are_those_of_the_motion(six: Path, six_shown: MotionPlayback) -> None:
    found = six_shown
    assert found.periods == 3
    one = plan(six)
    rows = (found.times_s / one.sample_period_s).round().astype(int)
    assert rows[0] == 0
    assert rows[-1] == len(one.position) - 1
    np.testing.assert_array_equal(found.position, one.position[rows])
    assert [name for _, name in found.phases] == ["run-in", "transient", "main part", "run-out"]
    for start_s, name in found.phases:
        row = round(start_s / one.sample_period_s)
        assert Phase(one.phase[row]).name.lower().replace("_", "-") == name.split()[0]
        assert row == 0 or one.phase[row - 1] != one.phase[row]


def test_every_sample_of_a_fast_long_motion_is_near_the_shown_poses(
    fast: Path, fast_shown: MotionPlayback
) -> None:
    found, samples = fast_shown, plan(fast)
    assert largest_deviation(found, samples) <= np.radians(0.5)
    assert found.deviation_rad == pytest.approx(largest_deviation(found, samples))
    assert len(found.times_s) < MOST_POSES


def test_the_drawn_path_is_near_the_tool_point_of_pinocchio(
    fast: Path, fast_shown: MotionPlayback
) -> None:
    found, samples = fast_shown, plan(fast)
    model, tool = pinocchio_of(KR15.robot)
    data = model.createData()
    for row in range(0, len(samples.position), 499):
        pin.forwardKinematics(model, data, samples.position[row])
        place = (data.oMi[-1] * tool).translation
        time_s = row * samples.sample_period_s
        line = [np.interp(time_s, found.times_s, axis) for axis in found.path_m.T]
        assert np.abs(line - place).max() <= 5e-3


def test_a_motion_with_too_many_poses_states_the_deviation(fast: Path) -> None:
    found = motion_playback(KR15, load_motion(fast), RestingPose(), most_poses=700)
    assert len(found.times_s) == 700
    assert found.deviation_rad == pytest.approx(largest_deviation(found, plan(fast)))
    assert found.deviation_rad > np.radians(0.5)
    assert not found.document()["is_accurate"]


def test_the_clearances_are_the_smallest_of_all_samples(
    six: Path, six_shown: MotionPlayback
) -> None:
    found, samples = six_shown.clearance, plan(six)
    assert found is not None
    clearances = Clearances.of(KR15.robot, KR15.config.workspace)
    edges = (found.times_s / samples.sample_period_s).round().astype(int)
    for number in range(0, len(edges) - 1, 37):
        nearest = clearances.nearest(samples.position[edges[number] : edges[number + 1] + 1])
        assert found.distance_m[number] == pytest.approx(nearest.min())
        assert found.pairs[number] == clearances.names[int(nearest.argmin())]
    assert found.distance_m.min() == pytest.approx(clearances.nearest(samples.position).min())


def test_a_closest_approach_of_a_moment_is_found_and_shown(near_miss: Path) -> None:
    found, samples = motion_playback(KR15, load_motion(near_miss), RestingPose()), plan(near_miss)
    clearance = found.clearance
    assert clearance is not None
    assert_declared(clearance.document(), "MotionClearance")
    assert_declared({**found.document(), "files_hash": ""}, "MotionPlayback")
    clearances = Clearances.of(KR15.robot, KR15.config.workspace)
    least = clearances.nearest(samples.position)
    assert clearance.distance_m.min() == pytest.approx(least.min())
    assert clearance.pairs[int(clearance.distance_m.argmin())] == clearances.names[least.argmin()]
    at_rest = clearances.nearest(samples.position[:1]).min()
    assert least.min() < at_rest - 0.02
    assert 59.0 < clearance.least_at_s < 62.0
    shown = found.position[np.abs(found.times_s - clearance.least_at_s).argmin()]
    assert clearances.nearest(shown[np.newaxis]).min() == pytest.approx(least.min())


def test_the_approach_from_the_present_pose_is_part_of_the_motion(six: Path) -> None:
    samples = plan(six)
    folded = (0.5, 0.9, -2.4, 0.3, 1.5, 0.0)
    found = motion_playback(KR15, load_motion(six), RestingPose(folded, "the preflight", 1e9))
    way = approach(np.array(folded), samples.position[0], KR15.robot, KR15.config.cycle_time_s)
    assert found.times_s[0] == pytest.approx(-way.duration_s)
    np.testing.assert_array_equal(found.position[0], folded)
    first = int(np.flatnonzero(found.times_s == 0.0)[0])
    np.testing.assert_array_equal(found.position[first], samples.position[0])
    assert found.phases[0] == (found.times_s[0], "approach")
    assert found.phases[1] == (0.0, "run-in")
    clearances = Clearances.of(KR15.robot, KR15.config.workspace)
    on_the_way, later = (clearances.nearest(part.position).min() for part in (way, samples))
    assert found.clearance is not None
    assert on_the_way < later
    assert found.clearance.distance_m.min() == pytest.approx(on_the_way)
    assert found.clearance.least_at_s < 0.0


def test_a_motion_from_outside_the_limits_has_no_approach(six: Path) -> None:
    outside = RestingPose((9.0, 0.0, 0.0, 0.0, 0.0, 0.0), "the preflight", 1e9)
    found = motion_playback(KR15, load_motion(six), outside)
    assert found.times_s[0] == 0.0
    assert "axis1" in found.no_approach


def test_a_robot_without_bodies_has_no_clearance(motion: str, tmp_path: Path) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(motion)
    assert motion_playback(load_cell("ir361"), load_motion(path), RestingPose()).clearance is None


@pytest.mark.slow
def test_a_motion_is_played_and_can_be_scrubbed(
    open_page: OpenPage, served_pages: ServedProcess, six: Path, screenshots: Path
) -> None:
    page = open_page()
    page.goto(served_pages.url.split("/?")[0] + "/cells/kr15/experiment")
    wait_for_picture(page)
    expect(page.locator("#view .view-state")).to_contain_text("PLANNED MOTION, NO LIVE DATA")
    found = motion_playback(KR15, load_motion(six), RestingPose())
    end_s = found.times_s[-1]
    expect(page.locator(CLOCK)).to_contain_text(f"0.0 of {end_s:.1f} s")

    before = picture_of(page)
    row = int(np.abs(found.position - found.position[0]).max(axis=1).argmax())
    page.locator("#view .player input").fill(str(found.times_s[row]))
    page.wait_for_timeout(400)  # the table changes five times a second
    wait_until_drawn(page)
    assert changed_share(before, picture_of(page)) > 0.01
    shown = page.locator("#view tbody td.number:not(.soft)").all_inner_texts()
    assert [float(text.split()[0]) for text in shown] == pytest.approx(
        np.degrees(found.position[row]), abs=0.051
    )
    assert found.clearance is not None
    least = int(found.clearance.distance_m.argmin())
    expect(page.locator("#view .clearance")).to_contain_text(
        f"{1e3 * found.clearance.distance_m[least]:.0f} mm between {found.clearance.pairs[least]}"
    )

    page.locator("#view .player input").fill(str(end_s - 0.5))
    frames = page.evaluate("document.getElementById('view').robotView.drawing.frames")
    page.locator("#view .player button").click()
    expect(page.locator(CLOCK)).to_contain_text(f"{end_s:.1f} of {end_s:.1f} s")
    expect(page.locator("#view .player button")).to_have_text("Play")  # it has ended
    assert page.evaluate("document.getElementById('view').robotView.drawing.frames") > frames

    page.set_viewport_size({"width": 390, "height": 900})
    slider = page.locator("#view .player input").bounding_box()
    assert slider is not None
    assert slider["width"] > 150.0  # the words of the clock do not push it aside

    require_axe(page)
    for dark in (False, True):
        page.emulate_media(color_scheme="dark" if dark else "light")
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            page.wait_for_timeout(300)
            assert not page.evaluate(CUT_OFF)
            name = f"experiment-3d-{width}-{'dark' if dark else 'light'}.png"
            page.screenshot(path=screenshots / name, full_page=True)
