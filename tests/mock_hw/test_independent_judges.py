"""Simulated drives and bus, checked by independent programs: `canopen` as a master and tshark as a
listener.
"""

from __future__ import annotations

import queue
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import canopen
import pytest
from canopen.emcy import EmcyError
from canopen.objectdictionary import ODRecord, ODVariable
from canopen.profiles.p402 import BaseNode402

from config.load import LoadedCell, load_cell
from drivers.cell import open_cell
from mock_hw.cell import SimulatedCell
from mock_hw.drive.objects import SimulatedIdentity, drive_entries
from mock_hw.simulation import CellSimulation

PATIENCE_S = 120.0
RETRIED_S = 5.0
TYPES = {"B": 5, "b": 2, "H": 6, "h": 3, "I": 7, "i": 4, "s": 9}


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def simulated(loaded: LoadedCell) -> Iterator[SimulatedCell]:
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=True, seed=0)
    ) as simulated:
        yield simulated


@pytest.fixture
def network(simulated: SimulatedCell) -> Iterator[canopen.Network]:
    with canopen.Network() as network:
        network.connect(interface="rid_sim", channel=simulated.channel)
        yield network


def dictionary(loaded: LoadedCell, number: int) -> canopen.ObjectDictionary:
    """Return the drive's object dictionary for the `canopen` package."""
    assert loaded.plant is not None
    axis = loaded.config.axes[number]
    identity = SimulatedIdentity.of_axis(
        loaded.config, axis, loaded.robot.joints[number], loaded.plant.axes[number]
    )
    objects = canopen.ObjectDictionary()
    entries = [*drive_entries(identity)]
    records = {entry.index for entry in entries if entry.subindex}
    for entry in entries:
        name = f"{entry.index:04X}:{entry.subindex}"
        variable = ODVariable(name, entry.index, entry.subindex)
        variable.data_type = TYPES[entry.code]
        if entry.index in records:
            if entry.index not in objects:
                objects.add_object(ODRecord(f"{entry.index:04X}", entry.index))
            record = objects[entry.index]
            assert isinstance(record, ODRecord)
            record.add_member(variable)
        else:
            objects.add_object(variable)
    return objects


def reset(node: canopen.RemoteNode, command: str) -> None:
    """Send an NMT command that causes a boot-up message, and wait for the message."""
    # The message can be the boot-up of power-on. Requests that the reset then loses are repeated.
    node.sdo.RESPONSE_TIMEOUT, node.sdo.MAX_RETRIES = RETRIED_S, round(PATIENCE_S / RETRIED_S)
    booted = threading.Event()
    node.nmt.add_heartbeat_callback(lambda state: booted.set() if state == 0 else None)
    node.nmt.state = command
    assert booted.wait(PATIENCE_S)


def test_canopen_brings_a_drive_to_operation_enabled_and_reads_its_position(
    network: canopen.Network, simulated: SimulatedCell, loaded: LoadedCell
) -> None:
    node = BaseNode402(1, dictionary(loaded, 0))
    network.add_node(node)
    reset(node, "RESET COMMUNICATION")
    assert node.sdo[0x1008].raw == "rid-daq simulated servo drive"
    assert node.sdo[0x1000].raw & 0xFFFF == 402
    node.sdo[0x6060].raw = 9
    node.TIMEOUT_SWITCH_STATE_FINAL = node.TIMEOUT_SWITCH_STATE_SINGLE = PATIENCE_S
    node.TIMEOUT_CHECK_TPDO = PATIENCE_S
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
        assert node.state == state
    assert simulated.axes().enabled.tolist() == [True, False, False]
    counts = node.sdo[0x6064].raw
    per_rev = node.sdo[0x608F][1].raw
    gear = node.sdo[0x6091][1].raw / node.sdo[0x6091][2].raw
    position = counts / per_rev / gear * 2.0 * 3.141592653589793
    assert position == pytest.approx(float(simulated.axes().position[0]), abs=1e-3)
    node.state = "SWITCH ON DISABLED"
    assert node.sdo[0x6041].raw & 0x4F == 0x40
    assert not simulated.axes().enabled.any()


def test_canopen_maps_its_own_pdo_and_receives_it_with_sync(
    network: canopen.Network, loaded: LoadedCell, simulated: SimulatedCell
) -> None:
    node = canopen.RemoteNode(2, dictionary(loaded, 1))
    network.add_node(node)
    reset(node, "RESET")
    node.tpdo.read()
    node.tpdo[2].clear()
    node.tpdo[2].add_variable(0x6064)
    node.tpdo[2].add_variable(0x6077)
    node.tpdo[2].cob_id = 0x282
    node.tpdo[2].trans_type = 1
    node.tpdo[2].enabled = True
    node.tpdo[2].save()
    came = threading.Event()
    node.tpdo[2].add_callback(lambda _: came.set())
    node.nmt.state = "OPERATIONAL"
    network.sync.transmit()
    assert came.wait(PATIENCE_S)
    assert node.tpdo[2][0].raw == node.sdo[0x6064].raw


def test_canopen_receives_aborts_heartbeats_and_emergencies(
    network: canopen.Network, loaded: LoadedCell
) -> None:
    node = canopen.RemoteNode(3, dictionary(loaded, 2))
    network.add_node(node)
    reset(node, "RESET")
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo.download(0x605A, 0, b"\x03\x00")
    assert refused.value.code == 0x0609_0030
    with pytest.raises(canopen.SdoAbortedError) as unknown:
        node.sdo.upload(0x2345, 0)
    assert unknown.value.code == 0x0602_0000
    node.sdo[0x1017].raw = 20
    assert node.nmt.wait_for_heartbeat(PATIENCE_S) == "PRE-OPERATIONAL"
    node.sdo[0x1016][1].raw = 0x7F << 16 | 30
    emergencies: queue.SimpleQueue[EmcyError] = queue.SimpleQueue()
    node.emcy.add_callback(emergencies.put)
    network.send_message(0x77F, b"\x05")
    emergency = emergencies.get(timeout=PATIENCE_S)
    assert (emergency.code, emergency.register) == (0x8130, 0x11)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tsharks_canopen_dissector_accepts_the_log(loaded: LoadedCell, tmp_path: Path) -> None:
    assert loaded.plant is not None
    log = tmp_path / "bus.log"
    with (
        SimulatedCell(
            CellSimulation(
                loaded.config, loaded.robot, loaded.plant, realtime=False, seed=0, log=log
            )
        ) as simulated,
        open_cell(simulated.cell, loaded.robot) as cell,
    ):
        cell.axes.bring_up()
        cell.axes.start()
        cell.axes.enable()
    dissected = subprocess.run(
        [
            *("tshark", "-r", str(log), "-d", "can.subdissector,canopen", "-T", "fields"),
            *("-e", "_ws.col.Protocol", "-e", "_ws.expert.message", "-e", "_ws.col.Info"),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    ).stdout.splitlines()
    assert len(dissected) == len(log.read_text().splitlines()) > 500
    rows = [row.split("\t") for row in dissected]
    assert {protocol for protocol, _, _ in rows} == {"CANopen"}
    assert {expert for _, expert, _ in rows} == {""}
    decoded = {info.split(" [")[0].strip() for _, _, info in rows}
    assert {
        "NMT Error Control: Boot-up",
        "NMT: Start remote node",
        "Default-SDO (rx): Initiate upload request",
        "Default-SDO (tx): Initiate download response",
        "SYNC",
        "PDO1 (tx)",
        "PDO1 (rx)",
    } <= decoded, decoded
