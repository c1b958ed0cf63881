"""A cell is opened by one session at a time, and not while a service owns it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import LockedError, PreflightError
from config.load import LoadedCell, load_cell
from rid_daq.session import cells
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.session.ownership import own_cell
from tests.builders.raised_codes import raises_code


@pytest.fixture
def real(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LoadedCell:
    """Return a real cell; opening it sends nothing."""
    monkeypatch.setattr("rid_daq.session.session.machine_lock_folders", lambda: [tmp_path])
    loaded = load_cell("ir361")
    can = loaded.config.can.model_copy(update={"interface": "socketcan", "channel": "can9"})
    config = loaded.config.model_copy(update={"simulated": False, "can": can})
    return replace(loaded, config=config)


def test_an_open_real_cell_is_refused_to_other_sessions(real: LoadedCell) -> None:
    with (
        hold_reachable_cell(real),
        raises_code(LockedError, "RID-CELL-BUSY"),
        hold_reachable_cell(real),
    ):
        pass
    with hold_reachable_cell(real):
        pass


def test_a_cell_owned_by_a_service_is_refused_to_others(
    real: LoadedCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rid_daq.session.ownership.file_holder", lambda _: 1)
    with raises_code(LockedError, "RID-CELL-BUSY", "process 1"), hold_reachable_cell(real):
        pass


def test_a_second_service_of_a_cell_is_refused(real: LoadedCell) -> None:
    with own_cell(real.config), raises_code(LockedError, "RID-CELL-BUSY"), own_cell(real.config):
        pass


def test_a_cell_with_unsuitable_data_sheets_is_not_opened(
    real: LoadedCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_loaded: LoadedCell) -> None:
        raise PreflightError("axis1, node 1: 6077h:00 is missing", code="RID-EDS-UNFIT")

    monkeypatch.setattr(cells, "refuse_unfit_eds", refuse)
    with raises_code(PreflightError, "RID-EDS-UNFIT", "axis1"), hold_reachable_cell(real):
        pass
    with hold_reachable_cell(real, any_eds=True):
        pass
