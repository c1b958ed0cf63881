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
from rid_daq.preflight.bus_check import NOT_TESTED, CheckLine
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code

FINE = CheckLine("drives", "seen to stop", "", "", "ok")
WAITS = CheckLine("axis1", NOT_TESTED, "", "", "red", "clear the cell")
Looked = Callable[..., None]


def real_cell(*, with_power: bool) -> LoadedCell:
    """Return a cell of real drives."""
    loaded = load_cell("ir361")
    config = loaded.config
    safety = config.drive_safety.model_copy(update={"trip_watchdog_with_power": with_power})
    real = config.model_copy(update={"simulated": False, "drive_safety": safety})
    return replace(loaded, config=real)


@pytest.fixture
def looks() -> list[bool]:
    """One entry for each look at the drives: True if the user has confirmed a clear cell."""
    return []


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, looks: list[bool]) -> Looked:
    """Return what checks a cell whose drives tell by trial only how they react."""

    def look(typed: str = "", *, cleared: bool = False, with_power: bool = False) -> None:
        loaded = real_cell(with_power=with_power)

        def preflight(*_: object, cleared: bool, **__: object) -> tuple[list[CheckLine], None]:
            looks.append(cleared)
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

    return look


def test_a_trial_with_power_waits_until_a_person_has_cleared_the_cell(
    looked: Looked, looks: list[bool]
) -> None:
    looked(typed="ir361")
    assert looks == [False, True]


def test_where_that_was_said_nobody_is_asked(looked: Looked, looks: list[bool]) -> None:
    looked(cleared=True)
    assert looks == [True]


def test_where_the_cell_file_wants_power_it_is_asked_first(
    looked: Looked, looks: list[bool]
) -> None:
    looked(typed="ir361", with_power=True)
    assert looks == [True]
    with raises_code(PreflightError, "RID-ANSWER-NOBODY", "ir361"):
        looked(with_power=True)
    assert looks == [True]


def test_where_nobody_can_be_asked_it_stays_red(looked: Looked, looks: list[bool]) -> None:
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", "ir361", "preflight"):
        looked()
    assert looks == [False]


def test_who_does_not_type_the_name_of_the_cell_gets_no_power(
    looked: Looked, looks: list[bool], capsys: pytest.CaptureFixture[str]
) -> None:
    with raises_code(PreflightError, "RID-ANSWER-NO", "no motion", "'yes'", "'ir361'"):
        looked(typed="yes")
    assert looks == [False]
    assert "brakes" in capsys.readouterr().out
