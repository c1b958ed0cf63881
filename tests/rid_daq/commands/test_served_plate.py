"""Commands find the simulated serial ports of a cell that `rid-daq mock` serves."""

from __future__ import annotations

import signal
from dataclasses import replace

import pytest

from config.cell.monitor import ModbusRtu
from config.load import load_cell
from drivers.amplifier.amplifier import open_amplifier
from mock_hw.cell import SimulatedCell
from mock_hw.host.runtime_directory import plate_path, registers_path, runtime_directory
from mock_hw.simulation import CellSimulation
from rid_daq.preflight.monitor_check import monitor_lines
from rid_daq.session.cells import hold_reachable_cell
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import screen_lines
from tests.builders.typist import Typist

pytestmark = pytest.mark.slow


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
            CellSimulation(
                loaded.config,
                loaded.robot,
                loaded.plant,
                realtime=True,
                seed=0,
                directory=runtime_directory(),
                amplifier_profile=loaded.amplifier_profile,
            )
        ) as simulated,
        hold_reachable_cell(loaded) as (cell, _),
    ):
        assert cell.plate is not None
        assert cell.plate.amplifier.address == simulated.address
        assert simulated.address == str(plate_path(can.channel))
        with open_amplifier(cell.plate.amplifier, loaded.amplifier_profile) as amplifier:
            assert "simulated" in amplifier.connect()
    assert not plate_path(can.channel).exists()


def test_the_serial_port_of_the_drives_of_a_served_cell_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("run")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    loaded = load_cell("kr15")
    assert loaded.plant is not None
    assert loaded.config.monitor is not None
    link = ModbusRtu(kind="rtu", address="/dev/ttyUSB0", baud_rate=19200, parity="even")
    can = loaded.config.can.model_copy(update={"channel": f"served-{folder.name}"})
    monitor = loaded.config.monitor.model_copy(update={"link": link})
    config = loaded.config.model_copy(update={"can": can, "monitor": monitor})
    loaded = replace(loaded, config=config)
    assert loaded.plant is not None
    with (
        SimulatedCell(
            CellSimulation(
                config,
                loaded.robot,
                loaded.plant,
                realtime=True,
                seed=0,
                directory=runtime_directory(),
            )
        ),
        hold_reachable_cell(loaded) as (cell, _),
    ):
        assert cell.monitor is not None
        assert isinstance(cell.monitor.link, ModbusRtu)
        assert cell.monitor.link.address == str(registers_path(can.channel))
        lines = monitor_lines(cell, loaded.robot, loaded.drive_profile)
    assert [line.found for line in lines if line.what == "motor temperature [°C]"] == ["25.0"] * 6


def test_a_served_cell_names_the_port_of_its_plate(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))
    with Typist("mock", "ir361") as person:
        person.wait_for_text("rid-daq check ir361")
        shown = "\n".join(screen_lines(person.shown))
        person.program.send_signal(signal.SIGINT)
        assert person.wait_for_end() == 0
    assert_shown("force-plate", "rid-daq mock ir361", shown)
