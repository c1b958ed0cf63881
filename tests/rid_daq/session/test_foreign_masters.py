"""Exclusive control: a second session is refused, and a foreign master stops the first."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from config.errors import LockedError
from config.load import LoadedCell, load_cell
from drivers.cell import open_cell
from mock_hw.bus.hub_client import HubClient
from mock_hw.bus.hub_protocol import HubRole
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.session.session import hold_cell
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

PROBE = 0x655  # an SDO request to a node that does not exist: it has no effect
QUICK_STOP = "020000000000"


@dataclass
class Logged:
    """A simulated cell whose frames are logged."""

    loaded: LoadedCell
    simulated: SimulatedCell
    log: Path

    def frames(self) -> list[tuple[float, int, str]]:
        """Return (time [s], identifier, data) of all frames on the bus."""
        rows = (line.split() for line in self.log.read_text(encoding="ascii").splitlines())
        return [
            (float(row[0].strip("()")), int(row[2].split("#")[0], 16), row[2].split("#")[1])
            for row in rows
        ]


@pytest.fixture
def logged_cell(tmp_path: Path) -> Iterator[Logged]:
    loaded = load_cell("ir361")
    config = loaded.config.model_copy(update={"plate": None})
    assert loaded.plant is not None
    log = tmp_path / "bus.log"
    with SimulatedCell(
        CellSimulation(config, loaded.robot, loaded.plant, realtime=False, seed=3, log=log)
    ) as simulated:
        yield Logged(loaded, simulated, log)


@pytest.mark.fault(32)
def test_a_second_session_on_the_bus_is_refused_and_sends_nothing(
    logged_cell: Logged, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    cell = tmp_path / "cell.json"
    config = logged_cell.simulated.cell.model_dump(mode="json") | {
        "simulated": False,
        "plant": None,
    }
    cell.write_text(json.dumps(config))
    with hold_cell(logged_cell.simulated.cell):
        second = subprocess.run(
            [sys.executable, "-m", "rid_daq", "check", str(cell), "--i-have-cleared-the-cell"],
            capture_output=True,
            text=True,
            check=False,
        )
    assert second.returncode == 8, second.stderr
    assert "[RID-CELL-BUSY]" in second.stderr
    logged_cell.simulated.__exit__(None, None, None)
    sent = [frame for frame in logged_cell.frames() if not 0x700 < frame[1] < 0x77F]
    assert sent == []
    measured("the second session: exit code 8, 0 frames sent")


@pytest.mark.fault(32)
def test_a_foreign_master_before_the_session_is_refused(
    logged_cell: Logged, measured: Callable[[str], None]
) -> None:
    stranger = HubClient(Path(logged_cell.simulated.channel), HubRole.OBSERVER)
    ours: list[int] = []
    try:
        with open_cell(logged_cell.simulated.cell, logged_cell.loaded.robot) as cell:
            stranger.send(0x080, b"", 0)
            with raises_code(LockedError, "RID-CAN-FOREIGN-MASTER") as refused:
                cell.axes.bring_up()
    finally:
        stranger.close()
    logged_cell.simulated.__exit__(None, None, None)
    assert type(refused.value).__name__ == "LockedError"
    ours = [frame[1] for frame in logged_cell.frames() if not 0x700 < frame[1] < 0x77F]
    assert ours == [0x080], "only the foreign SYNC is on the bus"
    measured("another master's SYNC before the session: exit code 8, 0 frames sent")


@pytest.mark.fault(32)
def test_a_foreign_master_in_motion_causes_a_quick_stop_in_the_next_cycle(
    logged_cell: Logged, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    config = logged_cell.simulated.cell
    stranger = HubClient(Path(logged_cell.simulated.channel), HubRole.OBSERVER)
    once = threading.Lock()

    def intrude(progress: object) -> None:
        if getattr(progress, "phase", None) == Phase.MAIN and once.acquire(blocking=False):
            stranger.send(PROBE, bytes(8), 8)

    joints = tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.2,), cosine=(0.0,))
        for name in logged_cell.loaded.robot.joint_names
    )
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=500, ramp_s=1.0, joints=joints
    )
    samples = motion.plan(logged_cell.loaded.robot, config.cycle_time_s)
    folder = RunFolder.create(tmp_path / "runs", "intruded")
    try:
        outcome = record_motion(
            config, logged_cell.loaded.robot, samples, folder, on_progress=intrude
        )
    finally:
        stranger.close()
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.BUS
    assert "another master is active on this bus: it sends SDO requests" in outcome.stop.text
    logged_cell.simulated.__exit__(None, None, None)
    frames = logged_cell.frames()
    intruded_s = next(time_s for time_s, cob_id, _ in frames if cob_id == PROBE)
    after = [frame for frame in frames if frame[0] > intruded_s and frame[1] == 0x201]
    stopped_s = next(time_s for time_s, _, data in after if data == QUICK_STOP)
    cycles = (stopped_s - intruded_s) / config.cycle_time_s
    assert cycles <= 2.0
    assert all(data[:4] in ("0200", "0000") for time_s, _, data in after if time_s >= stopped_s)
    measured(
        f"another master's SDO request during a motion: quick stop {cycles:.1f} cycles later, never"
        " cancelled"
    )
