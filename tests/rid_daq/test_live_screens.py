"""Output of commands that run until the user ends them, at 80 and at 120 columns."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest

from config.load import load_cell, to_yaml
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import WIDTHS, Screen, store_screen, too_wide
from tests.builders.typist import Typist

pytestmark = pytest.mark.slow


@pytest.fixture(params=WIDTHS)
def columns(request: pytest.FixtureRequest) -> int:
    assert isinstance(request.param, int)
    return request.param


@pytest.fixture
def cell_without_plate(tmp_path: Path) -> str:
    """Return the bundled cell without its force plate, with another name and bus."""
    found = load_cell("ir361").config
    can = found.can.model_copy(update={"channel": f"screens{os.getpid()}"})
    changes = {"plate": None, "name": "arm", "can": can}
    (tmp_path / "arm.yaml").write_text(to_yaml(found.model_copy(update=changes)))
    return str(tmp_path / "arm.yaml")


def run_in_terminal(columns: int, folder: Path, *words: object) -> Typist:
    """Return a terminal in which a command runs, with separate session locks."""
    size = {"COLUMNS": str(columns), "LINES": "100", "TERM": "xterm-256color"}
    places = {"RID_DAQ_LOCKS": str(folder)}
    return Typist(*words, environment={**size, **places, "FORCE_COLOR": "1"})


def shown_lines(person: Typist, columns: int, words: Sequence[str]) -> list[str]:
    """Store the screen of a terminal; return its lines, which must fit the width."""
    screen = Screen(tuple(words), columns, person.shown)
    store_screen(screen, "live")
    assert too_wide([line for line in screen.lines if line], columns) == []
    return screen.lines


def test_mock_shows_how_to_use_the_served_cell(
    columns: int, tmp_path: Path, cell_without_plate: str
) -> None:
    with run_in_terminal(columns, tmp_path, "mock", cell_without_plate) as person:
        person.wait_for_text("Next, in another terminal:")
        person.program.send_signal(signal.SIGINT)
        assert person.wait_for_end() == 0
        person.wait_for_text("Ended.")
    lines = shown_lines(person, columns, ["mock", "arm.yaml"])
    assert lines[-1] == "Ended."


def test_a_service_shows_the_address_of_its_pages(
    columns: int, tmp_path: Path, cell_without_plate: str
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    words = ["serve", cell_without_plate, "--folder", folder, "--listen", "127.0.0.1:0"]
    with run_in_terminal(columns, tmp_path, *words) as person:
        person.wait_for_text("Ctrl-C")
        person.wait_for_text("serving arm")
        person.program.send_signal(signal.SIGINT)
        assert person.wait_for_end() == 0
        person.wait_for_text("ended")
    lines = shown_lines(person, columns, ["serve", "arm.yaml"])
    assert any(line.strip().startswith(("Workbench: http", "http")) for line in lines)
    assert lines[-1].endswith("  ended")
    assert "{" not in "".join(lines)
    assert_shown("run-the-service", "rid-daq serve ir361", "\n".join(lines), same_numbers=False)


def test_a_jog_is_stopped_from_another_terminal(
    columns: int, tmp_path: Path, cell_without_plate: str
) -> None:
    with run_in_terminal(
        columns, tmp_path, "jog", cell_without_plate, "--runs", tmp_path / "runs"
    ) as person:
        person.wait_for_text("Ready: hold the key.")
        person.type("3")
        with person.hold_key("-"):
            person.wait_for_text("measuring", 2)
        with run_in_terminal(columns, tmp_path, "stop") as other:
            assert other.wait_for_end() == 0
        assert person.wait_for_end() == 5
        person.wait_for_text("report.html")
    jogged = shown_lines(person, columns, ["jog", "arm.yaml"])
    assert "Ready: hold the key." in jogged
    assert "Chosen: axis3." in jogged
    assert any(line.startswith("jog ") and "cycles" in line for line in jogged)
    stopped = "\n".join(shown_lines(other, columns, ["stop"]))
    assert_shown("watch-and-stop", "rid-daq stop", stopped, same_numbers=False)


def test_a_jog_ended_by_its_key_shows_its_run_folder(
    tmp_path: Path, cell_without_plate: str
) -> None:
    with run_in_terminal(
        80, tmp_path, "jog", cell_without_plate, "--runs", tmp_path / "runs"
    ) as person:
        person.wait_for_text("Ready: hold the key.")
        person.type("q")
        assert person.wait_for_end() == 0
        person.wait_for_text("report.html")
    lines = shown_lines(person, 80, ["jog", "arm.yaml", "q"])
    assert any(line.startswith("Recorded") for line in lines)
