"""A cell that `rid-daq mock` serves is joined with its plate at the port that was made for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.load import load_cell
from drivers.amplifier_serial import open_amplifier
from mock_hw.cell import SimulatedCell
from mock_hw.runtime_directory import plate_path, runtime_directory
from rid_daq.cells import reachable_cell


def test_the_plate_of_a_served_cell_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("run")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    loaded = load_cell("ir361")
    can = loaded.config.can.model_copy(update={"channel": f"served-{folder.name}"})
    loaded = replace(loaded, config=loaded.config.model_copy(update={"can": can}))
    assert loaded.plant is not None
    assert loaded.amplifier_profile is not None
    with (
        SimulatedCell(
            loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=True,
            seed=0,
            directory=runtime_directory(),
            profile=loaded.amplifier_profile,
        ) as simulated,
        reachable_cell(loaded) as cell,
    ):
        assert cell.plate is not None
        assert cell.plate.amplifier.address == simulated.address
        assert simulated.address == str(plate_path(can.channel))
        with open_amplifier(cell.plate.amplifier, loaded.amplifier_profile) as amplifier:
            assert "simulated" in amplifier.connect()
    assert not plate_path(can.channel).exists()
