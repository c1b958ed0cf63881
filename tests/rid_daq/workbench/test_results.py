"""Buttons of the pages: compare and recover runs, identify friction, compensate a path."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from compensation.loops.loop_file import write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.load import load_cell
from identification.estimation.file import write_estimate
from rid_daq.service.records import Job, JobState
from tests.builders.identified_run import arm_in_motion, friction_run, identified_run
from tests.builders.motion_texts import MULTISINE, PICK
from tests.builders.warm_model import by_temperature
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import begin_motion, leased_cell, until
from tests.rid_daq.workbench.conftest import OpenPage, give_back, go_to, take_cell
from tests.rid_daq.workbench.test_every_page import CUT_OFF, WIDTHS
from tests.rid_daq.workbench.test_work import pictured

pytestmark = pytest.mark.slow

TURNS = """
kind: circle
robot: ir361
centre_m: [0.575, -0.078, -1.724]
radius_m: 0.1
speed_m_s: 0.4
near: [0.1, -0.1, 0.4]
periods: 2
transient_periods: 1
ramp_s: 0.5
"""


@pytest.fixture(scope="module")
def identified(served_pages: ServedProcess) -> None:
    """Write two identified runs of the served arm; one joint has more friction in the newer one."""
    arm = arm_in_motion()
    identified_run(served_pages.folder / "runs", arm, "monday", 1)
    identified_run(served_pages.folder / "runs", arm, "dry", 3, fc_axis2=1.2)


@pytest.mark.usefixtures("identified")
def test_two_identified_runs_are_compared(open_page: OpenPage, screenshots: Path) -> None:
    page = open_page(width=820)
    page.get_by_role("link", name="Runs", exact=True).click()
    for label in ("monday", "dry"):
        expect(page.locator("#compare")).to_be_disabled()
        page.locator("#runs tr", has_text=label).get_by_role("checkbox").check()
    page.locator("#compare").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Compare: failed")  # verdict shown once
    expect(page.locator("#compared tr.red")).to_contain_text("fc_axis2")
    expect(page.locator("#compared")).to_contain_text("Conditions and verdicts")
    expect(page.locator("#job .said")).to_be_empty()
    pictured(page, screenshots, "runs-compared")
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert not page.evaluate(CUT_OFF), width


@pytest.mark.usefixtures("identified")
def test_models_are_named_by_their_run(open_page: OpenPage, served_pages: ServedProcess) -> None:
    page = open_page()
    for tab in ("Experiment", "Compensation", "Payload"):
        page.get_by_role("link", name=tab, exact=True).click()
        option = page.locator("#model option", has_text="dry (ir361), 20")
        path = option.get_attribute("value")
        assert path is not None
        assert (served_pages.folder / path).name == "model.json"
        expect(page.locator("#model option", has_text="model.json")).to_have_count(0)


def test_a_run_left_by_a_crash_is_recovered(
    open_page: OpenPage, served_pages: ServedProcess, long_motion: str
) -> None:
    with leased_cell(served_pages, long_motion) as key:
        job = begin_motion(served_pages, key)
        with served_pages.client as client:
            pid = client.job(job.id).pid
            assert pid is not None
            os.kill(pid, signal.SIGKILL)
            over = client.follow(job).job
            client.run("ir361", "reset", {}, lease=key).require_done()
    assert over.state is JobState.INTERRUPTED
    assert over.run is not None
    page = open_page()
    page.goto(f"{served_pages.url.split('/?')[0]}/cells/ir361/runs/{over.run}")
    page.get_by_role("link", name="recover it").click()
    page.get_by_role("button", name=re.compile("^Recover ")).first.click()
    expect(page.locator("#job .verdict").first).to_contain_text("Recovered: ")
    expect(page.locator("#job .verdict.end")).to_contain_text("Recover: ")
    page.locator("#status").select_option("recovered")
    expect(page.locator("#runs tbody tr")).to_have_count(1)


def test_a_run_that_is_recorded_now_is_not_offered_for_recovery(
    open_page: OpenPage, served_pages: ServedProcess, long_motion: str
) -> None:
    page = open_page()
    unfinished = page.locator("#runs tbody tr", has_text="unfinished")
    recover = page.get_by_role("button", name=re.compile("^Recover "))
    with leased_cell(served_pages, long_motion) as key:
        go_to(page, "Runs")
        expect(page.locator("#runs tbody tr")).not_to_have_count(0)
        before = unfinished.count(), recover.count()
        begin_motion(served_pages, key)
        page.reload()
        expect(unfinished).to_have_count(before[0] + 1)
        expect(recover).to_have_count(before[1])


def test_friction_is_identified_and_shown(
    open_page: OpenPage, served_pages: ServedProcess, screenshots: Path
) -> None:
    run = friction_run(served_pages.folder / "runs", "there and back", 7).run_id
    page = open_page(width=820)
    page.get_by_role("link", name="Friction", exact=True).click()
    expect(page.locator("#runs label")).to_have_count(1)  # only this run measures friction
    page.locator("#measure").click()
    expect(page.locator("#job [role=alert]")).to_contain_text("A run is missing")
    page.locator("#runs").get_by_role("checkbox").check()
    page.locator("#measure").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Friction: done")
    expect(page.locator("#result")).to_contain_text("in the robot file: friction: [")
    expect(page.locator("#job .results")).to_be_empty()  # the page shows the result below
    page.locator(
        "[data-figure=friction]"
    ).scroll_into_view_if_needed()  # a figure loads once it is visible
    expect(page.locator("[data-figure=friction] [data-figure-state=shown]").first).to_be_visible()
    page.goto(f"{page.url}?run={run}")  # the results are shown again
    expect(page.locator("#result .verdict", has_text="the fit is good")).to_have_count(3)
    pictured(page, screenshots, "friction-measured")


@pytest.fixture
def warming(served_pages: ServedProcess) -> Iterator[None]:
    """Write two files for one test, and delete them afterwards.

    They are a model whose friction depends on an unmeasured warming, and a file of velocity loops
    that no run measured.
    """
    cell, folder = load_cell("ir361"), served_pages.folder
    model, known = folder / "warming.json", folder / "known_loops.json"
    write_estimate(model, by_temperature(cell, measured=False))
    loops = [
        VelocityLoop(joint, 900.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for joint in cell.robot.joint_names
    ]
    write_loops(known, loops, "ir361", "a run")
    yield
    model.unlink()
    known.unlink()


@pytest.mark.usefixtures("identified", "warming")
def test_a_model_with_warming_requires_the_joint_temperature(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    """One field sets the temperature for `compensate`, `retime` and `refine`."""
    (served_pages.folder / "turns.yaml").write_text(TURNS)
    page = open_page(width=820)
    page.get_by_role("link", name="Compensation", exact=True).click()
    chosen = {"motion": "turns.yaml", "model": "warming.json", "loop": "known_loops.json"}
    for field, file in chosen.items():
        page.locator(f"#{field}").select_option(file)
    page.locator("#make").click()
    expect(page.locator("#job")).to_contain_text("depends on warming without thermometers")
    page.get_by_label("Temperature of the joints").fill(" warm ")
    page.locator("#make").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Compensate: done")
    assert newest(served_pages).request["temperature"] == "warm"
    page.get_by_text("Optional: first retime the motion").click()
    page.locator("#retime").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Retime: done")
    assert newest(served_pages).request["temperature"] == "warm"
    page.locator("#refine").click()  # the run has no feedforward
    expect(page.locator("#job .verdict.end")).to_contain_text("Refine: ")
    assert newest(served_pages).request["temperature"] == "warm"


@pytest.fixture(scope="module")
def multisine_run(served_pages: ServedProcess) -> str:
    """Record a multisine on the served arm; the cell is ready to move afterwards."""
    (served_pages.folder / "multisine.yaml").write_text(MULTISINE)
    client = served_pages.client
    with client, client.lease("ir361") as cell:
        cell.run("check", {"seconds": 0.2}).require_done()
        request = {"motion": "multisine.yaml", "label": "multisine"}
        run = cell.run("record", request, cleared=True).require_done().job.run
    assert run is not None
    return run


@pytest.mark.long
@pytest.mark.usefixtures("identified")
def test_loops_are_measured_and_a_path_is_compensated_compared_refined_and_streamed(
    open_page: OpenPage, served_pages: ServedProcess, multisine_run: str
) -> None:
    """Press the page's buttons step by step; each step uses the file of the previous one."""
    run = multisine_run
    (served_pages.folder / "turns.yaml").write_text(TURNS)
    (served_pages.folder / "pick.yaml").write_text(PICK)
    page = open_page(width=820)
    page.get_by_role("link", name="Compensation", exact=True).click()
    page.locator("#loop-run").select_option(run)
    page.locator("#measure").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Loop: done")
    rows = page.locator("#loops-result table").first.locator("tbody tr")
    expect(rows).to_have_count(3)
    expect(rows.first).to_contain_text("axis1")
    gain = float(rows.first.locator("td").nth(1).inner_text().split()[0])
    assert gain == pytest.approx(900.0, rel=0.05)
    bode = page.locator("[data-figure^=bode]").first
    bode.scroll_into_view_if_needed()  # a figure loads once it is visible
    expect(bode).to_have_attribute("data-figure-state", "shown")
    expect(page.locator("#loop")).to_have_value(f"runs/{run}/loops.json")
    assert (served_pages.folder / "runs" / run / "loops.json").is_file()
    page.locator("#motion").select_option("turns.yaml")
    page.locator("#make").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Compensate: done")
    expect(page.locator("#feedforward")).to_have_value("feedforward.json")
    after = page.locator("#after").input_value()
    page.locator("#before").select_option(after)
    page.locator("#compare").click()  # compares a run with itself
    expect(page.locator("#job [role=alert]")).to_contain_text(
        "The runs before and after are the same"
    )

    take_cell(page)
    buttons = ("#drive-plain", "#drive")
    runs = [run_by_button(page, served_pages, button, "Record: done") for button in buttons]
    expect(page.locator("#before")).to_have_value(runs[0])  # the newest other run of the motion
    expect(page.locator("#after")).to_have_value(runs[1])
    page.locator("#compare").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Tracking: done")
    reduced = page.locator("#path-result tbody tr").first.locator("td").nth(5)
    assert float(reduced.inner_text()) > 10.0

    expect(page.locator("#refine-run")).to_have_value(runs[1])
    page.locator("#refine-run-2").select_option(runs[1])  # the same run twice
    page.locator("#refine").click()
    expect(page.locator("#job [role=alert]")).to_contain_text("the same")
    page.locator("#refine-run-2").select_option("")
    page.locator("#refine").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Refine: done")
    expect(page.locator("#feedforward")).to_have_value("refined.json")
    expect(page.locator("#job .next")).to_contain_text("refine")
    assert (served_pages.folder / "refined.json").is_file()

    expect(page.locator("#compensated")).to_be_checked()
    streamed = run_by_button(page, served_pages, "#stream", "Stream: done")
    assert streamed not in runs
    assert newest(served_pages).request["options"] == {"compensated": True}
    give_back(page)

    page.locator("#motion").select_option("pick.yaml")
    page.get_by_text("Optional: first retime the motion").click()
    page.locator("#retime").click()
    expect(page.locator("#job .verdict.end")).to_have_text("Retime: done")
    expect(page.locator("#job .results")).to_contain_text("% shorter")
    expect(page.locator("#motion")).to_have_value("timed.yaml")
    page.reload()
    expect(page.locator("#motion option[value='timed.yaml']")).to_have_text(
        "timed.yaml (timed path)"
    )


def run_by_button(page: Page, served: ServedProcess, button: str, end: str) -> str:
    """Press a button that moves the robot, wait for the job's end, and return its run."""
    before = newest(served).id
    page.locator(button).click()
    page.get_by_role("dialog").get_by_role("button", name="is clear: start").click()
    until(lambda: newest(served).id != before)
    with served.client as client:
        run = client.follow(newest(served)).require_done().job.run
    assert run is not None
    expect(page.locator("#after")).to_have_value(run)  # the page offers the file
    expect(page.locator("#job .verdict.end")).to_have_text(end)
    return run


def newest(served: ServedProcess) -> Job:
    with served.client as client:
        return Job.model_validate(client.ask("GET", "/jobs?limit=1")[0])
