"""Simulated drives and robot without processes: units, torque limit, seeds, snapshots."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from config.cell.cell import CellConfig
from config.errors import ConfigError, TransportError
from config.load import LoadedCell, load_cell
from drivers.canopen.frames import SYNC, Frame
from drivers.servo.cia402 import AxisUnits, MotorRatings
from drivers.servo.requirements import cyclic_pdos
from mock_hw.plant.snapshot import SnapshotReader, SnapshotWriter
from mock_hw.rack import DriveRack
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008
COMMAND = struct.Struct("<Hi")
ANSWER = struct.Struct("<Hih")


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def rack_of(
    loaded: LoadedCell, cell: CellConfig, seed: int = 1, snapshots: SnapshotWriter | None = None
) -> DriveRack:
    assert loaded.plant is not None
    return DriveRack(cell, loaded.robot, loaded.plant, seed, snapshots)


class Master:
    """Minimal master: mapping, mode and start of the drives, then cycles."""

    def __init__(self, rack: DriveRack, cell: CellConfig) -> None:
        self.rack = rack
        self.nodes = [axis.node_id for axis in cell.axes]
        self.frames: list[tuple[float, Frame]] = []
        rack.advance(0.1)
        for node in self.nodes:
            for pdo in cyclic_pdos(node, "full"):
                for write in pdo.writes():
                    self.write(node, write.index, write.subindex, write.data)
            self.write(node, 0x6060, 0, b"\x09")
            self.write(node, 0x60C2, 1, b"\x08")
        rack.receive(Frame(0, b"\x01\x00"), rack.time_s)

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, subindex)
        self.rack.receive(Frame(0x600 + node, head + data.ljust(4, b"\0")), self.rack.time_s)
        answers = [f for _, _, f in self.rack.take_frames() if f.cob_id == 0x580 + node]
        assert answers[0].data[0] == 0x60, answers

    def cycle(self, word: int, velocities: list[int]) -> list[tuple[int, int, int]]:
        """Return status word, counts and torque of every drive."""
        now_s = self.rack.time_s + CYCLE_S
        self.rack.receive(SYNC, now_s)
        sent = [(time_s, frame) for _, time_s, frame in self.rack.take_frames()]
        self.frames += sent
        for node, velocity in zip(self.nodes, velocities, strict=True):
            self.rack.receive(Frame(0x200 + node, COMMAND.pack(word, velocity)), now_s)
        by_id = {frame.cob_id: frame.data for _, frame in sent}
        return [ANSWER.unpack(by_id[0x180 + node]) for node in self.nodes]

    def run(self, velocities: list[int], cycles: int = 40) -> list[tuple[int, int, int]]:
        for word in (0x00, 0x06, 0x07):
            self.cycle(word, [0] * len(velocities))
        answers = [self.cycle(0x0F, velocities) for _ in range(cycles)]
        return answers[-1]


@pytest.fixture
def snapshot(tmp_path: Path) -> Path:
    return tmp_path / "axes.bin"


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("velocity_unit", ["increments_per_s", "rpm", "0.1rpm"])
def test_a_drives_values_are_those_of_the_joints_motion(
    loaded: LoadedCell, snapshot: Path, direction: int, velocity_unit: str
) -> None:
    assert loaded.plant is not None
    changes = {"direction": direction, "velocity_unit": velocity_unit, "position_zero_counts": -777}
    axes = tuple(axis.model_copy(update=changes) for axis in loaded.config.axes)
    cell = loaded.config.model_copy(update={"axes": axes})
    rack = rack_of(loaded, cell, snapshots=SnapshotWriter(snapshot, 3))
    units = [
        AxisUnits.of_motor(
            MotorRatings(
                simulated.encoder_increments_per_motor_rev, simulated.rated_motor_torque_nm
            ),
            cell.servo_of(axis),
            joint.gear_ratio,
            axis.direction,
            axis.position_zero_counts,
        )
        for axis, joint, simulated in zip(axes, loaded.robot.joints, loaded.plant.axes, strict=True)
    ]
    answers = Master(rack, cell).run([round(0.2 * unit.velocity_units_per_rad_s) for unit in units])
    with SnapshotReader(snapshot) as reader:
        truth = reader.read()
    assert truth.time_s == rack.time_s
    assert truth.enabled.all()
    assert truth.velocity == pytest.approx(np.full(3, 0.2), abs=0.02)
    positions = [unit.position(counts) for unit, (_, counts, _) in zip(units, answers, strict=True)]
    assert positions == pytest.approx(truth.position, abs=1e-3)
    torques = [unit.torque_nm(raw) for unit, (_, _, raw) in zip(units, answers, strict=True)]
    assert torques == pytest.approx(truth.torque, abs=0.15 * float(np.abs(truth.torque).max()))


def test_the_torque_limit_is_kept(loaded: LoadedCell) -> None:
    highest = []
    for permille in (100, 3000):
        rack = rack_of(loaded, loaded.config)
        master = Master(rack, loaded.config)
        for node in master.nodes:
            master.write(node, 0x6072, 0, permille.to_bytes(2, "little"))
        master.run([0, 0, 0])
        torques = [master.cycle(0x0F, [50_000] * 3) for _ in range(60)]
        highest.append(max(abs(raw) for answers in torques for _, _, raw in answers))
    assert highest[0] < 130, (
        "at most 0.1 of the rated torque, plus the overshoot of the anti-alias filter"
    )
    assert highest[1] > 200


def test_the_frames_depend_on_the_seed_alone(loaded: LoadedCell) -> None:
    sent = []
    for seed in (1, 1, 2):
        master = Master(rack_of(loaded, loaded.config, seed), loaded.config)
        master.run([10_000, -10_000, 5_000])
        sent.append(master.frames)
    assert sent[0] == sent[1]
    assert sent[0] != sent[2]


def test_joints_without_a_drive_are_named(loaded: LoadedCell) -> None:
    cell = loaded.config.model_copy(update={"axes": loaded.config.axes[:2]})
    with raises_code(ConfigError, "RID-CELL-JOINTS"):
        rack_of(loaded, cell)


def test_a_missing_snapshot_is_a_transport_error(snapshot: Path) -> None:
    with raises_code(TransportError, "RID-MOCK-NOT-SERVED"):
        SnapshotReader(snapshot)


def test_an_inconsistent_snapshot_is_detected(snapshot: Path) -> None:
    writer = SnapshotWriter(snapshot, 1)
    writer.write(1.0, [2.0], [3.0], [4.0], [True], [300.0])
    with SnapshotReader(snapshot) as reader:
        assert reader.read().position.tolist() == [2.0]
        writer._memory[0:8] = (3).to_bytes(8, "little")
        with raises_code(TransportError, "RID-MOCK-ENDED", "incomplete"):
            reader.read()
