"""The form of every operation, generated from its request, and the request that it sends."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from rid_daq.operations.catalogue import CATALOGUE, operation
from rid_daq.workbench.menu import MENU, command_links
from rid_daq.workbench.operation_form import form_sections
from rid_daq.workbench.static_files import static_files
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenPage, estimated

LINKED = """async (text) => {
  const { linked } = await import("/static/commands.js");
  const { render } = await import("/static/lit.js");
  const place = document.createElement("p");
  document.querySelector("main").append(place);
  render(linked(text), place);
  const links = [...place.querySelectorAll("a")].map((each) => each.pathname);
  return { text: place.innerText, links };
}"""
JOBS = [name for name, entry in CATALOGUE.items() if entry.is_job]


@pytest.mark.parametrize("name", JOBS)
def test_a_form_has_every_field_that_a_client_can_set(name: str) -> None:
    found = operation(name)
    fields = [each for fields in form_sections(found).values() for each in fields]
    paths = [each.path for each in fields]
    assert len(set(paths)) == len(paths)
    assert {path.split(".")[0] for path in paths} == found.request.model_fields.keys() - found.owned
    assert all(each.hint for each in fields)
    assert all(each.choices for each in fields if each.kind == "choice")


def test_every_job_of_a_page_is_declared_in_the_menu_and_has_its_button() -> None:
    kinds = {name: operation(name).kind for name in JOBS}
    declared, begun = set(), set()
    for entry in MENU:
        script = static_files().get(f"{entry.path.strip('/') or 'cell'}.js", b"").decode()
        buttons = set(re.findall(r'begin\("(\w+)"', script))
        jobs = {kinds[name] for name in entry.operations if name in kinds}
        assert jobs <= buttons, entry.path
        declared |= jobs
        begun |= buttons
    assert begun == declared


def test_a_command_leads_to_the_page_with_its_button() -> None:
    links = command_links()
    assert {
        name: links[name][0] for name in ("plate zero", "record", "payload", "runs", "stiffness")
    } == {
        "plate zero": "",
        "record": "/experiment",
        "payload": "/payload",
        "runs": "/runs",
        "stiffness": "/operations/stiffness",
    }
    short = {"payload", "calibrate"}  # each stands for its default operation
    assert links.keys() - set(JOBS) == {*short, "runs"}  # a page lists the runs, without a job
    assert (
        f"export const LINKS = {json.dumps(links)}" in static_files()["command_links.js"].decode()
    )


@pytest.mark.slow
def test_a_message_names_fields_and_runs_instead_of_options_and_ids(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    run = "01M8PX6N28PQPKVF7CF00ZTB80"
    page = open_page()
    page.goto(f"{served_pages.url.split('/?')[0]}/cells/ir361/identify")
    expect(page.locator("#solve-why")).not_to_be_empty()
    shown = page.evaluate(
        LINKED, f"use --band 7 or --mass-limit; runs/{run}: `--choose`, `rid-daq check X`"
    )
    assert (
        shown["text"] == "use “Highest frequency [Hz]” 7 or “mass limit”; the run: “choose”, Check"
    )
    assert shown["links"] == [f"/cells/ir361/runs/{run}", "/cells/ir361"]
    page.goto(f"{served_pages.url.split('/?')[0]}/cells/ir361/operations/record")
    expect(page.locator("#begin")).to_be_visible()
    expect(page.locator("main")).not_to_contain_text(re.compile(r"--[a-z]|`"))


@pytest.mark.slow
def test_a_form_sends_its_values_as_json(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = _form(open_page, served_pages, "retime")
    page.locator("[name=motion]").fill("turns.yaml")
    page.locator("[name=model]").fill("model.json")
    page.locator("[name=output]").fill("timed.yaml")
    page.locator("[name=margin]").fill("0,05")
    page.locator("[name=jerk]").fill("100\n200,5\n\n300")
    page.locator("[name=base]").check()
    assert _sent_request(page, "retime") == {
        "motion": "turns.yaml",
        "model": "model.json",
        "output": "timed.yaml",
        "margin": 0.05,
        "jerk": [100, 200.5, 300],
        "base": True,
    }
    problems.clear()  # the console reports the refused request
    page.locator("[name=margin]").fill("0,05 kg")
    page.locator("#begin").click()
    expect(page.locator("#margin-problem")).to_contain_text('margin: "0,05 kg"')


@pytest.mark.slow
def test_a_value_with_several_parts_is_entered_on_one_line(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = _form(open_page, served_pages, "payload_identify")
    page.locator("[name=loaded]").fill("a\nb")
    page.locator("[name=known]").fill("m 2,8 0.005\ncz 0.1 0")
    known = [
        {"name": "m", "value": 2.8, "sigma": 0.005},
        {"name": "cz", "value": 0.1, "sigma": 0},
    ]
    assert _sent_request(page, "payload_identify") == {"loaded": ["a", "b"], "known": known}
    problems.clear()


@pytest.mark.slow
def test_the_service_names_the_field_that_it_refuses(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = _form(open_page, served_pages, "retime")
    for name, value in {"motion": "turns.yaml", "model": "model.json", "output": "t.yaml"}.items():
        page.locator(f"[name={name}]").fill(value)
    page.locator("[name=confidence]").fill("7")
    page.locator("#begin").click()
    expect(page.locator("#job [role=alert]")).to_contain_text("confidence: 7")
    problems.clear()


@pytest.mark.slow
def test_a_form_starts_its_job_and_shows_the_result(
    open_page: OpenPage, served_pages: ServedProcess, screenshots: Path
) -> None:
    first, second = (
        estimated(served_pages.folder / "runs", label, value)
        for label, value in (("spring", 3.0), ("autumn", 4.0))
    )
    page = open_page()
    page.get_by_role("link", name="All operations").click()
    page.get_by_role("link", name="Recover a recording").click()
    expect(page.locator("#runs option")).to_have_count(2)  # suggested while the user types
    page.goto(f"{page.url}?what={first}")
    expect(page.locator("[name=what]")).to_have_value(first)
    page.locator("#begin").click()
    expect(page.locator("#job .verdict.end")).to_contain_text("Recover: failed")
    page.screenshot(path=screenshots / "operation-recover.png", full_page=True)
    assert second != first


def _form(open_page: OpenPage, served: ServedProcess, kind: str) -> Page:
    page = open_page()
    page.goto(f"{served.url.split('/?')[0]}/cells/ir361/operations/{kind}")
    expect(page.locator("#begin")).to_be_enabled()
    return page


def _sent_request(page: Page, kind: str) -> object:
    """Press the start button, and return the request, which is intercepted."""
    requests: list[Any] = []

    def keep(route: Route) -> None:
        requests.append(route.request.post_data_json)
        route.fulfill(status=409, json={"error": "Refused", "message": "kept by a test"})

    page.route("**/cells/ir361/jobs", keep)
    page.locator("#begin").click()
    expect(page.locator("#job")).to_contain_text("kept by a test")
    page.unroute("**/cells/ir361/jobs")
    (request,) = requests
    assert request["kind"] == kind
    return request["request"]


@pytest.mark.parametrize(
    ("kind", "needs"), [("axes", "held"), ("jog", "held"), ("record", "ready"), ("check", "lease")]
)
def test_a_form_of_a_held_motion_does_not_require_an_earlier_axis_test(
    open_page: OpenPage, kind: str, needs: str
) -> None:
    page = open_page()
    page.goto(f"{page.url.split('?')[0]}/operations/{kind}")
    expect(page.locator("#begin")).to_have_attribute("data-needs", needs)
