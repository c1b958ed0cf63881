"""Questions of `rid-daq check` before drives are switched on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import PreflightError
from config.load import LoadedCell, load_cell
from rid_daq.operations.cell import check, checked_cell
from rid_daq.operations.perform import perform
from rid_daq.preflight.bus_check import NOT_TESTED
from rid_daq.preflight.check_line import CheckLine
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code

FINE = CheckLine("drives", "seen to stop", "", "", "ok")
WAITS = CheckLine("axis1", NOT_TESTED, "", "", "red", "clear the cell")
Looked = Callable[..., None]


def real_cell(*, with_power: bool) -> LoadedCell:
    """Return the bundled cell as a cell with real drives."""
    loaded = load_cell("ir361")
    config = loaded.config
    safety = config.drive_safety.model_copy(update={"trip_watchdog_with_power": with_power})
    real = config.model_copy(update={"simulated": False, "drive_safety": safety})
    return replace(loaded, config=real)


@pytest.fixture
def preflights() -> list[bool]:
    """One entry per preflight: True if the user has confirmed that the cell is clear."""
    return []


@pytest.fixture
def check_cell(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, preflights: list[bool]) -> Looked:
    """Return a function that checks a cell whose watchdogs can only be tested with power."""

    def check_once(typed: str = "", *, cleared: bool = False, with_power: bool = False) -> None:
        loaded = real_cell(with_power=with_power)

        def preflight(*_: object, cleared: bool, **__: object) -> tuple[list[CheckLine], None]:
            preflights.append(cleared)
            return [FINE if cleared else WAITS], None

        @contextmanager
        def mounted(*_: object, **__: object) -> Iterator[tuple[object, None]]:
            yield loaded.config, None

        monkeypatch.setattr(checked_cell, "load_cell", lambda _: loaded)
        monkeypatch.setattr(checked_cell, "preflight", preflight)
        monkeypatch.setattr(checked_cell, "hold_reachable_cell", mounted)
        monkeypatch.setattr(Console, "can_ask", property(lambda _: bool(typed)))
        monkeypatch.setattr(Console, "ask", lambda *_: typed)
        monkeypatch.setattr(Console, "confirm", lambda *_: True)
        request = check.CheckRequest(cell="real", runs=tmp_path, cleared=cleared)
        perform(check.OPERATION, request, Console(False))

    return check_once


def test_a_trial_with_power_is_made_after_the_user_has_cleared_the_cell(
    check_cell: Looked, preflights: list[bool]
) -> None:
    check_cell(typed="ir361")
    assert preflights == [False, True]


def test_a_cell_cleared_by_option_needs_no_question(
    check_cell: Looked, preflights: list[bool]
) -> None:
    check_cell(cleared=True)
    assert preflights == [True]


def test_a_cell_file_that_requires_power_asks_before_the_first_preflight(
    check_cell: Looked, preflights: list[bool]
) -> None:
    check_cell(typed="ir361", with_power=True)
    assert preflights == [True]
    with raises_code(PreflightError, "RID-ANSWER-NOBODY", "ir361"):
        check_cell(with_power=True)
    assert preflights == [True]


def test_without_a_terminal_the_trial_stays_red(check_cell: Looked, preflights: list[bool]) -> None:
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", "ir361", "preflight"):
        check_cell()
    assert preflights == [False]


def test_another_answer_than_the_cell_name_gives_no_power(
    check_cell: Looked, preflights: list[bool], capsys: pytest.CaptureFixture[str]
) -> None:
    with raises_code(PreflightError, "RID-ANSWER-NO", "no motion", "'yes'", "'ir361'"):
        check_cell(typed="yes")
    assert preflights == [False]
    assert "brakes" in capsys.readouterr().out
