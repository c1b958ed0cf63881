"""A page keeps the user's entries after a change of page, and is reloaded after an update of the
service.
"""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, Route, expect

from rid_daq.workbench import static_files
from tests.builders.bad_link import BadLink
from tests.builders.identified_run import friction_run
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.workbench.conftest import OpenByLink, OpenPage, go_to

pytestmark = pytest.mark.slow


def test_entries_survive_a_change_of_page_back_and_a_reload(open_page: OpenPage) -> None:
    page = open_page()
    go_to(page, "Payload")
    page.get_by_text("Required accuracy, number of runs").click()
    for field, value in {"mass": "9.6", "label": "gripper", "mass-limit-kg": "0.05"}.items():
        page.locator(f"#{field}").fill(value)

    def expect_entries() -> None:
        for field, value in {"mass": "9.6", "label": "gripper", "mass-limit-kg": "0.05"}.items():
            expect(page.locator(f"#{field}")).to_have_value(value)
        expect(page.locator("#mass-limit-kg")).to_be_visible()

    go_to(page, "Runs")
    page.go_back()
    expect_entries()
    go_to(page, "Identify")
    page.get_by_text("Selected terms").click()
    page.get_by_label("cubic").check()
    page.get_by_text("More choices").click()
    page.locator("#weighting").select_option("huber")
    go_to(page, "Payload")
    expect_entries()
    page.reload()
    expect_entries()
    go_to(page, "Identify")
    expect(page.get_by_label("cubic")).to_be_checked()
    expect(page.locator("#weighting")).to_have_value("huber")


def test_secrets_are_not_kept(open_page: OpenPage) -> None:
    page = open_page()
    go_to(page, "Settings")
    page.locator("#pairing-code").fill("123 456")
    go_to(page, "Runs")
    go_to(page, "Settings")
    expect(page.locator("#pairing-code")).to_have_value("")


def test_a_list_that_is_read_again_keeps_the_ticks_of_its_runs(
    open_by_link: OpenByLink, link: BadLink, served_pages: ServedProcess
) -> None:
    runs = served_pages.folder / "runs"
    first = friction_run(runs, "first", 7).run_id
    page = open_by_link()
    go_to(page, "Friction")
    page.locator(f"#runs input[value='{first}']").check()
    second = friction_run(runs, "second", 8).run_id
    link.cut()
    expect(page.locator("#reach")).to_be_visible()
    link.mend()
    expect(page.locator(f"#runs input[value='{second}']")).not_to_be_checked()
    expect(page.locator(f"#runs input[value='{first}']")).to_be_checked()
    expect(page.locator("#runs label")).to_have_count(2)
    page.locator(f"#runs input[value='{first}']").uncheck()
    third = friction_run(runs, "third", 9).run_id
    link.cut()
    expect(page.locator("#reach")).to_be_visible()
    link.mend()
    expect(page.locator(f"#runs input[value='{third}']")).to_be_visible()
    expect(page.locator("#runs input:checked")).to_have_count(0)


def test_a_token_that_cannot_be_revoked_stays_in_the_list(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = open_page()
    go_to(page, "Settings")
    open_page()  # another paired browser
    page.reload()
    rows = page.locator("#tokens tbody tr")
    expect(rows).not_to_have_count(0)  # the list is loaded
    before = rows.count()

    def refuse(route: Route) -> None:
        route.fulfill(status=409, json={"error": "Refused", "message": "kept by a test"})

    page.route("**/tokens/*", refuse)
    rows.last.get_by_role("button", name="Revoke").click()
    page.get_by_role("dialog").get_by_role("button", name="Revoke").click()
    expect(page.locator("#revoke-problem")).to_contain_text("kept by a test")
    expect(rows).to_have_count(before)
    problems.clear()  # the browser reports the refusal


def outdated(page: Page) -> None:
    """Let the service answer as a newer version does after a restart."""

    def refuse(route: Route) -> None:
        route.fulfill(status=404, json={"code": "RID-PAGE-OUTDATED", "message": "reload"})

    page.route("**/shell.js?is-current", refuse)


LOADED = "performance.timeOrigin"


def test_a_page_is_reloaded_after_an_update_of_the_service(
    open_by_link: OpenByLink, link: BadLink
) -> None:
    page = open_by_link()
    expect(page.locator("#now")).not_to_have_text("…")
    first = page.evaluate(LOADED)
    link.cut()
    expect(page.locator("#reach")).to_be_visible()
    link.mend()
    expect(page.locator("#reach")).to_be_hidden()
    assert page.evaluate(LOADED) == first  # the same version
    outdated(page)
    link.cut()
    expect(page.locator("#reach")).to_be_visible()
    with page.expect_navigation():
        link.mend()
    assert page.evaluate(LOADED) > first


def test_the_version_of_the_pages_changes_with_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {static_files.static_version.__wrapped__()}
    monkeypatch.setattr(static_files, "program_version", lambda: "0.2.0")
    versions.add(static_files.static_version.__wrapped__())
    assert len(versions) == 2
    assert all(re.fullmatch("[0-9a-f]{16}", each) for each in versions)
