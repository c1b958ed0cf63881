"""Recorder of every bus frame in a BLF file, compared with the log of the simulated bus."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path

import can
import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.runs.folder import RunFolder
from acquisition.session.frame_recorder import FrameRecorder
from acquisition.session.record import record_motion
from config.cell.cell import CanBusConfig
from config.errors import ConfigError, DriverError, RecordingError, TransportError
from config.load import load_cell
from drivers.canopen.frames import SYNC_COB_ID, tpdo_cob_id
from drivers.ports.python_can import open_bus
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Frame = tuple[int, bytes, int]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "frames.log"


@pytest.fixture
def simulated(log: Path) -> SimulatedCell:
    loaded = load_cell("ir361")
    assert loaded.plant is not None
    config = loaded.config.model_copy(update={"plate": None, "monitor": None})
    return SimulatedCell(
        CellSimulation(config, loaded.robot, loaded.plant, realtime=False, seed=1, log=log)
    )


def frames(reader: can.io.generic.MessageReader) -> list[Frame]:
    """Return identifier, data and time [us] of each frame."""
    return [(m.arbitration_id, bytes(m.data), round(1e6 * m.timestamp)) for m in reader]


def test_the_file_contains_every_frame_on_the_bus(
    simulated: SimulatedCell, log: Path, tmp_path: Path
) -> None:
    robot = load_cell("ir361").robot
    joints = tuple(
        FourierJoint(joint=name, sine=(0.1,), cosine=(0.0,)) for name in robot.joint_names
    )
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=1.0, periods=1, ramp_s=0.5, joints=joints
    )
    file = tmp_path / "frames.blf"
    with simulated as cell:
        samples = motion.plan(robot, cell.cell.cycle_time_s)
        with FrameRecorder(cell.cell.can, file) as recorder:
            run = RunFolder.create(tmp_path / "runs", "frames")
            outcome = record_motion(cell.cell, robot, samples, run)
            count = recorder.finish()
    recorded = frames(can.BLFReader(file))
    # the bus can log frames after the recorder has finished
    logged = frames(can.CanutilsLogReader(log))[:count]
    assert [frame[:2] for frame in recorded] == [frame[:2] for frame in logged]
    apart_us = np.array([a[2] - b[2] for a, b in zip(recorded, logged, strict=True)])
    assert np.ptp(apart_us) <= 2, "both are rounded"
    rows = read_journal(outcome.path).rows
    identifiers = [frame[0] for frame in recorded]
    assert identifiers.count(SYNC_COB_ID) >= len(rows)
    answered = {data[2:6] for cob_id, data, _ in recorded if cob_id == tpdo_cob_id(2)}
    measured = {count.tobytes() for count in rows["position_counts"][:, 1]}
    assert measured <= answered


def test_a_lost_bus_is_reported_and_the_received_frames_are_kept(
    simulated: SimulatedCell, tmp_path: Path
) -> None:
    file = tmp_path / "frames.blf"
    with contextlib.ExitStack() as stack:
        with simulated as cell:
            recorder = stack.enter_context(FrameRecorder(cell.cell.can, file))
            with (
                open_bus(cell.cell.can, listening=True) as listener,
                open_bus(cell.cell.can) as master,
            ):
                master.send(can.Message(arbitration_id=0x123, data=b"abc", is_extended_id=False))
                received: list[int] = []
                while 0x123 not in received:
                    master.recv(0.001)  # simulated time passes while the master waits
                    message = listener.recv(0.1)
                    received += [message.arbitration_id] if message else []
        with raises_code(TransportError, "RID-CAN-LOST", "ir361.sock"):
            recorder.finish()
    assert (0x123, b"abc") in [frame[:2] for frame in frames(can.BLFReader(file))]


def test_a_failed_session_leaves_a_complete_file_and_no_traceback(
    simulated: SimulatedCell, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "frames.blf"
    session_error = DriverError("the session's own")
    with (
        simulated as cell,
        pytest.raises(DriverError) as caught,
        FrameRecorder(cell.cell.can, file),
    ):
        raise session_error
    assert caught.value is session_error
    assert capfd.readouterr().err == ""
    assert [frame[0] for frame in frames(can.BLFReader(file))].count(SYNC_COB_ID) == 0


def test_a_bus_that_cannot_be_recorded_is_refused_at_the_start(
    simulated: SimulatedCell, tmp_path: Path
) -> None:
    slcan = CanBusConfig(interface="slcan", channel="/dev/ttyACM0", bitrate=1_000_000)
    names = ("can.interface slcan", "rid_sim, socketcan,", "--frames")
    with raises_code(ConfigError, "RID-CAN-INTERFACE", *names):
        FrameRecorder(slcan, tmp_path / "frames.blf")
    nobody = CanBusConfig(interface="rid_sim", channel=str(tmp_path / "no"), bitrate=1_000_000)
    with (
        raises_code(TransportError, "RID-CAN-OPEN", nobody.channel),
        FrameRecorder(nobody, tmp_path / "frames.blf"),
    ):
        pass
    existing = tmp_path / "taken.blf"
    existing.touch()
    with (
        simulated as cell,
        raises_code(
            RecordingError, "RID-RECORDING-LOST", f"{existing}: ", os.strerror(errno.EEXIST)
        ),
        FrameRecorder(cell.cell.can, existing),
    ):
        pass
