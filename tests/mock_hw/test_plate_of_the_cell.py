"""Plate under the simulated robot, read over its serial port by the driver for real plates."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.cell.cell import CellConfig
from config.errors import ProtocolError
from config.load import LoadedCell, load_cell
from config.simulation.faults import AmplifierFault, FaultScript
from drivers.amplifier.amplifier import SerialAmplifier, open_amplifier
from drivers.amplifier.simulated_arrivals import arrivals_path
from drivers.cell import Cell, open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.plant.rigid_bodies import BaseWrench
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Array = np.ndarray[Any, np.dtype[Any]]
ENOUGH_S = 120.0


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def simulate(loaded: LoadedCell, cell: CellConfig | None = None, **options: Any) -> SimulatedCell:
    assert loaded.plant is not None
    return SimulatedCell(
        CellSimulation(
            cell or loaded.config,
            loaded.robot,
            loaded.plant,
            seed=5,
            **{"realtime": False, **options},
        )
    )


def amplifier_of(simulated: SimulatedCell, loaded: LoadedCell) -> Any:
    plate = simulated.cell.plate
    assert plate is not None
    assert loaded.amplifier_profile is not None
    return open_amplifier(plate.amplifier, loaded.amplifier_profile)


def set_up(amplifier: SerialAmplifier) -> None:
    amplifier.connect()
    amplifier.configure()
    amplifier.reset()
    amplifier.operate()


class Reads:
    """Data received from the amplifier during a motion."""

    def __init__(self) -> None:
        self.rows: list[Array] = []
        self.arrivals: list[Array] = []
        self.events: list[Array] = []
        self.syncs_s: list[float] = []

    def add(self, read: Any) -> None:
        self.rows.append(read.rows)
        self.arrivals.append(read.arrival_s)
        self.events.append(read.events)

    def joined(self) -> tuple[Array, Array, Array]:
        rows, arrivals, events = map(np.concatenate, (self.rows, self.arrivals, self.events))
        return rows, arrivals, events


def move_and_rest(cell: Cell, amplifier: SerialAmplifier, cycles: int) -> Reads:
    """Move all axes back and forth, and let them rest at the end."""
    reads = Reads()
    period_s = cell.config.cycle_time_s
    set_up(amplifier)  # at rest, with closed brakes
    cell.axes.bring_up()
    cell.axes.start()
    next_s = cell.axes.enable()
    amplifier.start()
    for cycle in range(cycles):
        next_s += period_s
        cell.clock.sleep_until(next_s)
        now_s = cell.axes.exchange()
        reads.syncs_s.append(now_s)
        moving = cycle < 0.6 * cycles
        speed = 0.5 * math.sin(0.03 * cycle) if moving else 0.0
        assert cell.axes.command(np.full(3, speed))
        cell.axes.send_heartbeat(now_s)
        reads.add(amplifier.read(0.0))
    for read in amplifier.stop(time.monotonic() + ENOUGH_S):
        reads.add(read)
    return reads


def run(loaded: LoadedCell, cycles: int, cell: CellConfig | None = None, **options: Any) -> Any:
    """Return rows, arrivals, events, times of SYNC, and positions before and after the motion."""
    with simulate(loaded, cell, **options) as simulated:
        with (
            amplifier_of(simulated, loaded) as amplifier,
            open_cell(simulated.cell, loaded.robot) as opened,
        ):
            start = simulated.axes().position
            reads = move_and_rest(opened, amplifier, cycles)
            end = simulated.axes().position
        return (*reads.joined(), reads.syncs_s, start, end)


def test_a_lock_step_stream_is_repeatable_to_the_byte(loaded: LoadedCell) -> None:
    one, two = (run(loaded, 125) for _ in range(2))
    rows, arrivals, events = one[:3]
    assert (rows == two[0]).all()
    assert (arrivals == two[1]).all()
    assert (events == two[2]).all()
    assert rows["sequence"].tolist() == list(range(len(rows)))
    assert len(rows) >= 1.4 * 0.008 * 125 * 1000
    # The amplifier's clock is 100 ppm fast and starts at 3 ms; a row takes 0.6 ms on the line.
    late_s = arrivals - (rows["ticks"] * 1e-6 - 0.003) / 1.0001
    assert (np.diff(arrivals) >= 0.0).all()
    assert late_s.min() == pytest.approx(28 * 10 / 460800, abs=2e-4)
    assert 0.003 < late_s[100:].max() < 0.0065


def test_the_plate_measures_the_moving_weight(loaded: LoadedCell) -> None:
    plate, plant = loaded.config.plate, loaded.plant
    assert plate is not None
    assert plate.sensitivity is not None
    assert plant is not None
    truth = plant.plate
    assert truth is not None
    quiet = truth.model_copy(update={"zero_jump_pc": (0.0,) * 8, "drift_pc_s": (0.0,) * 8})
    still = LoadedCell(
        loaded.config,
        loaded.robot,
        plant.model_copy(update={"plate": quiet}),
        loaded.files,
        loaded.amplifier_profile,
    )
    rows, _, _, _, start, end = run(still, 250)
    per_count = np.array(plate.amplifier.newtons_per_count)
    channels = rows["counts"][-100:].mean(axis=0) * per_count
    fx12, fx34, fy14, fy23, *fz = np.linalg.solve(np.array(plate.sensitivity), channels)
    a, b, az0 = plate.a_m, plate.b_m, plate.az0_m
    felt = [
        fx12 + fx34,
        fy14 + fy23,
        sum(fz),
        b * (fz[0] + fz[1] - fz[2] - fz[3]) + (fy14 + fy23) * az0,
        a * (-fz[0] + fz[1] + fz[2] - fz[3]) - (fx12 + fx34) * az0,
        b * (-fx12 + fx34) + a * (fy14 - fy23),
    ]
    base = BaseWrench(loaded.robot, plant)
    before, after = (base(np.array([q, np.zeros(3), np.zeros(3)])) for q in (start, end))
    assert np.abs(before - after).max() > 20.0
    np.testing.assert_allclose(felt, before - after, atol=1.0)


def test_trigger_edges_have_the_times_of_sync(loaded: LoadedCell) -> None:
    plate = loaded.config.plate
    assert plate is not None
    amplifier = plate.amplifier.model_copy(update={"trigger": True, "rate_hz": 1000.0})
    cell = loaded.config.model_copy(
        update={"plate": plate.model_copy(update={"amplifier": amplifier})}
    )
    assert loaded.amplifier_profile is not None
    _, _, events, syncs_s, _, _ = run(loaded, 60, cell)
    edges = events[events["kind"] == loaded.amplifier_profile.events.trigger]
    assert edges["detail"].tolist() == list(range(len(edges)))
    assert len(edges) >= 58
    edge_s = (edges["ticks"] * 1e-6 - 0.003) / 1.0001
    # SYNC takes about 50 us on the CAN bus; edges of the first or last cycles can be missing.
    late_s = [
        edge_s - np.array(syncs_s[first : first + len(edge_s)])
        for first in range(3)
        if len(syncs_s[first : first + len(edge_s)]) == len(edge_s)
    ]
    assert any(((late >= 0.0) & (late < 2e-4)).all() for late in late_s)


def test_faults_of_the_line_are_reported_by_the_driver(loaded: LoadedCell) -> None:
    faults = FaultScript(
        seed=2,
        amplifier=(
            AmplifierFault(kind="gap", row=300, count=20),
            AmplifierFault(kind="garbage", row=500, count=100),
        ),
    )
    rows = run(loaded, 100, faults=faults)[0]
    assert set(range(len(rows) + 20)) - set(rows["sequence"].tolist()) == set(range(300, 320))


def test_another_baud_rate_of_the_amplifier_is_found_by_the_driver(loaded: LoadedCell) -> None:
    with (
        simulate(loaded, amplifier_baud_rate=115200) as simulated,
        amplifier_of(simulated, loaded) as amplifier,
        raises_code(ProtocolError, "RID-AMPLIFIER-SETTING", "plate.amplifier.baud_rate", "115200"),
    ):
        amplifier.connect()


def test_in_real_time_the_amplifier_answers_and_streams(loaded: LoadedCell) -> None:
    with simulate(loaded, realtime=True) as simulated:
        assert not arrivals_path(simulated.address).exists()
        with amplifier_of(simulated, loaded) as amplifier:
            assert "simulated" in amplifier.connect()
            amplifier.configure()
            amplifier.operate()
            amplifier.start()
            rows = 0
            while rows < 500:
                rows += len(amplifier.read(time.monotonic() + ENOUGH_S).rows)
            counts = amplifier.stream_counts
            assert (counts.rows_lost, counts.bad_frames, counts.garbage_bytes) == (0, 0, 0)


def test_a_cell_without_a_plate_has_no_amplifier_port(loaded: LoadedCell) -> None:
    bare = loaded.config.model_copy(update={"plate": None})
    with simulate(loaded, bare) as simulated:
        assert simulated.address == ""
        assert simulated.cell.plate is None
        assert not [*Path(simulated.channel).parent.glob("*.plate*")]
