"""Data that the pages show about files and past jobs, tested without a browser."""

from __future__ import annotations

import asyncio
import html
import re
import shlex
from pathlib import Path
from typing import get_args

import pytest

from acquisition.motion.fourier import samples_of_period
from acquisition.runs.folder import RunFolder
from config.load import load_cell
from config.robot.friction_terms import FRICTION_TERM_WORDS, FrictionTerm
from identification.choices import LoadFormat
from rid_daq.service.api.app import make_api
from rid_daq.service.api.runs import run_folder
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Role
from rid_daq.service.request_check import require_ending
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.workbench import runs_pages
from rid_daq.workbench.files.cell_sources import sources_of
from rid_daq.workbench.menu import MENU
from rid_daq.workbench.pages import PAGES
from rid_daq.workbench.robot_history import HistoryEntry, QuantityHistory, history_of
from tests.rid_daq.service.test_api import Api
from tests.rid_daq.workbench.conftest import estimated


@pytest.fixture
def cell_file(tmp_path: Path) -> Path:
    for name, content in load_cell("ir361").files.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path / "cell.yaml"


def test_an_error_is_shown_at_its_line(cell_file: Path) -> None:
    cell = ServedCell(str(cell_file), 1.0)
    assert [each.wrong_line for each in sources_of(cell, cell_file.parent)] == [None] * 4
    text = cell_file.read_text()
    line = next(i for i, each in enumerate(text.splitlines(), 1) if "cycle_time_ms" in each)
    cell_file.write_text(text.replace("cycle_time_ms: 8", "cycle_time_ms: -8"))
    sources = {each.name: each for each in sources_of(cell, cell_file.parent)}
    assert sources["cell.yaml"].wrong_line == line
    assert sources["cell.yaml"].lines[line - 1] == "cycle_time_ms: -8"
    assert sources["robot.yaml"].wrong_line is None


def test_the_history_of_a_robot_contains_only_its_runs(tmp_path: Path) -> None:
    first = estimated(tmp_path, "first", 3.0)
    estimated(tmp_path, "another robot", 9.0, robot="kr15")
    torn = estimated(tmp_path, "torn", 3.0)
    (tmp_path / torn / "result.json").write_text("{")
    last = estimated(tmp_path, "last", 4.0)
    (history,) = history_of(tmp_path, "ir361")
    assert (history.title, history.unit) == ("Coulomb friction of axis1", "N m")
    assert [each.run_id for each in history.entries] == [first, last]
    assert history.sentence == (
        "+1 N m from the first run to the newest: 7.1 standard deviations, more than noise"
        " explains."
    )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([(3.0, 0.1)], "Only one run"),
        ([(3.0, 0.1), (3.1, 0.1)], "0.7 standard deviations, noise can explain the change"),
        ([(3.0, 0.0), (3.1, 0.0)], "the uncertainty is unknown"),
    ],
)
def test_a_drift_is_compared_with_its_uncertainty(values, words) -> None:
    entries = [HistoryEntry("run", "", "", value, std) for value, std in values]
    assert words in QuantityHistory("mass", "kg", entries).sentence


def test_runs_are_searched_outside_the_event_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search_outside_loop(service: CellService, run: str) -> RunFolder:
        with pytest.raises(RuntimeError, match="no running event loop"):
            asyncio.get_running_loop()
        return run_folder(service, run)

    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    run = estimated(service.runs, "first", 3.0)
    monkeypatch.setattr(runs_pages, "run_folder", search_outside_loop)
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    page = api.ask(Role.VIEWER, "GET", f"/cells/ir361/runs/{run}")
    assert page.status_code == 200
    assert "result.json" in page.text
    assert api.ask(Role.VIEWER, "GET", "/cells/ir361/runs/none").status_code == 404


def test_a_page_of_another_program_version_must_be_reloaded(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    answer = api.ask(Role.VIEWER, "GET", "/static/0123456789abcdef/job_panel.js")
    assert (answer.status_code, answer.json()["code"]) == (404, "RID-PAGE-OUTDATED")


@pytest.mark.parametrize("path", [entry.path for entry in MENU])
def test_every_page_of_the_menu_is_rendered(tmp_path: Path, path: str) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    assert api.ask(Role.VIEWER, "GET", f"/cells/ir361{path}").status_code == 200


def test_the_settings_show_the_commands_of_a_new_cell(tmp_path: Path) -> None:
    folder = tmp_path / "of robots"
    folder.mkdir()
    service = CellService(folder, [ServedCell("ir361", 20.0), ServedCell("kr15", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    page = html.unescape(api.ask(Role.ADMINISTRATOR, "GET", "/cells/ir361/settings").text)
    init, serve = (
        shlex.split(each) for each in re.findall(r"(rid-daq (?:init|serve) .*)</pre>", page)
    )
    new = f"{folder}/new-cell"
    assert init == ["rid-daq", "init", new, "--urdf", "ROBOT.urdf"]
    cells = ["ir361", "kr15", f"{new}/cell.yaml"]
    assert serve == ["rid-daq", "serve", *cells, "--folder", str(folder)]


def test_the_model_can_have_every_friction_term_and_each_is_explained(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    page = api.ask(Role.VIEWER, "GET", "/cells/ir361/identify").text
    offered = re.findall(r'name="term" value="(\w+)"[^>]*> [\w ]+ <span class="soft">\(\w', page)
    assert offered == [*get_args(FrictionTerm)] == [*FRICTION_TERM_WORDS]


def test_the_usual_periods_of_a_motion_are_whole_cycles(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("kr15", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    page = api.ask(Role.VIEWER, "GET", "/cells/kr15/experiment").text
    field = re.search(r'<input id="period"[^>]*>', page)
    assert field is not None
    periods = re.findall(r'(?:value|data-multisine)="([\d.]+)"', field[0])
    cycle_s = service.cell("kr15").loaded.config.cycle_time_s
    assert [samples_of_period(float(each), cycle_s) for each in periods] == [833, 667]


def test_load_data_of_every_controller_can_be_chosen_and_saved(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("kr15", 20.0)])
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    page = api.ask(Role.VIEWER, "GET", "/cells/kr15/payload").text
    offered = dict(re.findall(r'<option value="([\w-]+)" data-ending="(\.\w+)">', page))
    assert offered.keys() == set(LoadFormat)
    for to, ending in offered.items():
        require_ending(JobKind("payload_export"), {"to": to, "output": f"load{ending}"})
