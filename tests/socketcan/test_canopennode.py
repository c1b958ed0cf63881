"""Tests against CANopenNode, an independent CANopen stack in C, as device and as master.

Both use SocketCAN. The program of CANopenNode for Linux is `canopend`, with the object dictionary
of its example (CiA 301 only). These tests run if RID_DAQ_SOCKETCAN names an interface that is up,
and `canopend` is on the path or named by RID_DAQ_CANOPEND. No package registry contains `canopend`;
it must be built from source.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from config.cell.cell import CanBusConfig
from config.load import load_cell
from drivers.canopen.emcy import parse_emcy
from drivers.canopen.frames import SYNC, Frame, emcy_cob_id, heartbeat_cob_id, tpdo_cob_id
from drivers.canopen.heartbeat import consumer_entry, heartbeat_frame
from drivers.canopen.nmt import NmtCommand, NmtState, nmt_frame
from drivers.canopen.pdo import MappedObject, PdoMapping
from drivers.canopen.sdo import SdoAbort, SdoCode
from drivers.ports.can_link import CanLink, open_can
from drivers.servo.sdo_port import SdoPort
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation

CHANNEL = os.environ.get("RID_DAQ_SOCKETCAN", "")
CANOPEND = os.environ.get("RID_DAQ_CANOPEND") or shutil.which("canopend") or ""
pytestmark = [
    pytest.mark.skipif(
        not CHANNEL, reason="test_guest.py runs this in its guest; or set RID_DAQ_SOCKETCAN=can0"
    ),
    pytest.mark.skipif(not CANOPEND, reason="canopend (CANopenNode for Linux) is not installed"),
]

DEVICE, MASTER, OURS = 10, 100, 127
PATIENCE_S = 60.0
WATCH_S = 0.5


class Device:
    """`canopend` as a device, and our port to the bus as its master."""

    def __init__(self, link: CanLink) -> None:
        self.link = link
        self.port = SdoPort(link, DEVICE, lambda frame, now_s: None, timeout_s=PATIENCE_S)

    def wait(self, matches: Callable[[Frame], bool], beat_s: float = 0.0) -> Frame:
        """Return the first frame that matches; until then send our heartbeat every `beat_s`."""
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            if beat_s:
                self.link.send(heartbeat_frame(OURS, NmtState.OPERATIONAL))
            frame = self.link.receive(self.link.clock.now_s() + (beat_s or 1.0))
            if frame is not None and matches(frame):
                return frame
        raise AssertionError("no matching frame arrived")

    def reaches(self, state: NmtState, command: NmtCommand) -> None:
        self.link.send(nmt_frame(command, DEVICE))
        heartbeat = Frame(heartbeat_cob_id(DEVICE), bytes((state,)))
        self.wait(lambda frame: frame == heartbeat)


def storage(folder: Path) -> str:
    """Return `canopend`'s storage option, with files that state that nothing is stored yet."""
    for name in ("od_comm", "mainline"):
        (folder / f"{name}.persist").write_text("-\n")
    return f"{folder}/"


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    with open_can(CanBusConfig(interface="socketcan", channel=CHANNEL)) as link:
        command = [CANOPEND, CHANNEL, "-i", str(DEVICE), "-s", storage(tmp_path)]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL) as process:
            try:
                opened = Device(link)
                opened.wait(lambda frame: frame == Frame(heartbeat_cob_id(DEVICE), b"\0"))
                opened.port.write(0x1017, 0, (50).to_bytes(2, "little"))
                yield opened
            finally:
                process.terminate()


def test_objects_are_read_written_and_refused(device: Device) -> None:
    port = device.port
    assert len(port.read(0x1000, 0)) == 4
    assert port.read_int(0x1018, 0) == 4
    port.write(0x1017, 0, (70).to_bytes(2, "little"))
    assert port.read_int(0x1017, 0) == 70
    for address, data, code in (
        ((0x6041, 0), None, SdoCode.NO_OBJECT),
        ((0x1018, 9), None, SdoCode.NO_SUBINDEX),
        ((0x1000, 0), bytes(4), SdoCode.READ_ONLY),
        ((0x1017, 0), bytes(4), SdoCode.LENGTH_TOO_HIGH),
        ((0x1017, 0), bytes(1), SdoCode.LENGTH_TOO_LOW),
    ):
        with pytest.raises(SdoAbort) as caught:
            port.read(*address) if data is None else port.write(*address, data)
        assert caught.value.code == code, address


def test_the_device_follows_our_nmt_commands(device: Device) -> None:
    device.reaches(NmtState.STOPPED, NmtCommand.STOP)
    device.reaches(NmtState.PRE_OPERATIONAL, NmtCommand.ENTER_PRE_OPERATIONAL)
    device.reaches(NmtState.OPERATIONAL, NmtCommand.START)


def test_the_device_accepts_our_mapping_and_answers_every_sync(device: Device) -> None:
    device.reaches(NmtState.PRE_OPERATIONAL, NmtCommand.ENTER_PRE_OPERATIONAL)
    pdo = PdoMapping("tpdo", 1, tpdo_cob_id(DEVICE), (MappedObject(0x1001, 0, 8),))
    for write in pdo.writes():
        device.port.write(write.index, write.subindex, write.data)
    for held in pdo.read_back():
        assert device.port.read(held.index, held.subindex) == held.data
    device.reaches(NmtState.OPERATIONAL, NmtCommand.START)
    for _ in range(20):
        device.link.send(SYNC)
        answer = device.wait(lambda frame: frame.cob_id == tpdo_cob_id(DEVICE))
        assert len(answer.data) == 1


def test_the_device_receives_our_heartbeat_and_detects_its_loss(device: Device) -> None:
    entry = consumer_entry(OURS, round(1000 * WATCH_S))
    device.port.write(0x1016, 1, entry.to_bytes(4, "little"))
    device.link.send(heartbeat_frame(OURS, NmtState.OPERATIONAL))
    device.reaches(NmtState.OPERATIONAL, NmtCommand.START)
    end_s, emergencies = time.monotonic() + 3 * WATCH_S, []

    def is_time_over(frame: Frame) -> bool:
        if frame.cob_id == emcy_cob_id(DEVICE) and parse_emcy(frame.data).code == 0x8130:
            emergencies.append(frame)
        return time.monotonic() > end_s

    device.wait(is_time_over, beat_s=WATCH_S / 10)
    assert emergencies == [], "our heartbeat was received"
    device.wait(
        lambda frame: frame.cob_id == emcy_cob_id(DEVICE) and parse_emcy(frame.data).code == 0x8130
    )


@pytest.fixture
def simulated() -> Iterator[SimulatedCell]:
    loaded = load_cell("ir361")
    values = {"can": CanBusConfig(interface="socketcan", channel=CHANNEL), "plate": None}
    loaded = replace(loaded, config=loaded.config.model_copy(update=values))
    assert loaded.plant is not None
    simulation = CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=True, seed=4)
    with SimulatedCell(simulation) as cell:
        yield cell


def gateway_answers(folder: Path, *commands: str) -> list[str]:
    """Return the answers of `canopend`'s gateway (CiA 309-3), one line per command.

    The gateway answers on its standard input, which is usually a terminal: here it is a socket.
    """
    command = [CANOPEND, CHANNEL, "-i", str(MASTER), "-s", storage(folder), "-c", "stdio"]
    ours, theirs = socket.socketpair()
    with ours, theirs, subprocess.Popen(command, stdin=theirs.fileno()) as process:
        ours.settimeout(PATIENCE_S)
        lines = ours.makefile("r", newline="\n")
        try:
            answers = []
            for number, each in enumerate(commands, start=1):
                ours.sendall(f"[{number}] {each}\n".encode())
                while not (line := lines.readline()).startswith(f"[{number}]"):
                    assert line, f"canopend ended before it answered {each!r}"
                answers.append(line.removeprefix(f"[{number}]").strip())
            return answers
        finally:
            process.terminate()


def test_a_foreign_master_reads_and_writes_objects_and_is_refused_by_our_drives(
    simulated: SimulatedCell, tmp_path: Path
) -> None:
    answers = gateway_answers(
        tmp_path,
        "set sdo_timeout 10000",
        "1 read 0x1000 0 u32",
        "1 read 0x1008 0 vs",
        "1 write 0x1017 0 u16 250",
        "1 read 0x1017 0 u16",
        "2 read 0x6041 0 u16",
        "1 read 0x2FFF 0 u8",
        "1 write 0x6041 0 u16 0",
        "set sdo_block 1",
        "1 read 0x1008 0 vs",
    )
    assert answers[0] == "OK"
    assert int(answers[1], 0) & 0xFFFF == 402
    assert answers[2] == '"rid-daq simulated servo drive"'
    assert (answers[3], int(answers[4], 0)) == ("OK", 250)
    assert int(answers[5], 0) & 0x4F == 0x40, "switch on disabled"
    assert "0x06020000" in answers[6]
    assert "0x06010002" in answers[7]
    assert answers[8] == "OK"
    assert "rid-daq" in answers[9] or "ERROR" in answers[9], "block transfer is refused properly"


def test_a_foreign_master_starts_and_stops_our_drives(
    simulated: SimulatedCell, tmp_path: Path
) -> None:
    with open_can(CanBusConfig(interface="socketcan", channel=CHANNEL)) as link:
        answers = gateway_answers(
            tmp_path, "3 write 0x1017 0 u16 20", "3 start", "3 stop", "3 preop"
        )
        assert answers == ["OK"] * 4
        states: list[int] = []
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s and states[-1:] != [NmtState.PRE_OPERATIONAL]:
            frame = link.receive(link.clock.now_s() + 1.0)
            if frame is not None and frame.cob_id == heartbeat_cob_id(3):
                states.append(frame.data[0])
        assert states[-1] == NmtState.PRE_OPERATIONAL
