"""SDO compared with the `canopen` package, as client and as server.

The package runs on python-can's ``virtual`` bus with its own receiving thread. Every wait ends with
an answer and not after a time, so that no test depends on the speed of the threads.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator

import can
import canopen
import pytest
from canopen.objectdictionary import ODRecord, ODVariable
from canopen.objectdictionary.datatypes import UNSIGNED8, UNSIGNED16, UNSIGNED32, VISIBLE_STRING

from config.cell.cell import CanBusConfig, CellConfig
from config.robot.robot import RobotDescription
from drivers.canopen.frames import Frame
from drivers.canopen.sdo import SdoAbort, SdoCode
from drivers.canopen.sdo_server import SdoServer
from drivers.ports.can_link import open_can
from drivers.servo.sdo_port import SdoPort
from drivers.servo.setup import DriveSetup
from tests.builders.raised_codes import raises_code

CHANNEL = "canopen-judge"
REACH = (-3.0, 3.0)
NODE = 5
TYPES = {1: UNSIGNED8, 2: UNSIGNED16, 4: UNSIGNED32}


@pytest.fixture
def network() -> Iterator[canopen.Network]:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02  # the receiving thread checks for its end in this interval [s]
    network.connect(interface="virtual", channel=CHANNEL)
    yield network
    network.disconnect()


class OurDevice(threading.Thread):
    """Our SDO server on a separate bus object; a remote frame ends it."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.objects = {(0x1000, 0): b"\x92\x01\x02\x00", (0x1008, 0): b"rid-daq test drive"}
        self.bus = can.Bus(interface="virtual", channel=CHANNEL)
        self.server = SdoServer(NODE, self.read, self.write)

    def read(self, index: int, subindex: int) -> bytes:
        try:
            return self.objects[index, subindex]
        except KeyError:
            raise SdoAbort(SdoCode.NO_OBJECT) from None

    def write(self, index: int, subindex: int, data: bytes) -> None:
        if index == 0x1000:
            raise SdoAbort(SdoCode.READ_ONLY)
        self.objects[index, subindex] = data

    def run(self) -> None:
        for message in self.bus:
            if message.is_remote_frame:
                return
            frame = Frame(message.arbitration_id, bytes(message.data))
            for answer in self.server.handle(frame, 0.0):
                self.bus.send(
                    can.Message(
                        arbitration_id=answer.cob_id, data=answer.data, is_extended_id=False
                    )
                )


@pytest.fixture
def device(network: canopen.Network) -> Iterator[OurDevice]:
    device = OurDevice()
    device.start()
    yield device
    network.send_message(0x7FF, b"", remote=True)
    device.join(120.0)
    device.bus.shutdown()


@pytest.fixture
def remote(network: canopen.Network, device: OurDevice) -> canopen.RemoteNode:
    node = network.add_node(NODE, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 30.0
    return node


class TestCanopenAsClient:
    def test_canopen_reads_from_our_server(self, remote: canopen.RemoteNode) -> None:
        assert remote.sdo.upload(0x1000, 0) == b"\x92\x01\x02\x00"
        assert remote.sdo.upload(0x1008, 0) == b"rid-daq test drive"

    @pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 7, 8, 14, 100])
    def test_canopen_writes_to_our_server(
        self, remote: canopen.RemoteNode, device: OurDevice, size: int
    ) -> None:
        data = bytes(range(size))
        remote.sdo.download(0x2000, 1, data)
        assert device.objects[0x2000, 1] == data
        assert remote.sdo.upload(0x2000, 1) == data

    def test_canopen_writes_in_segments_to_our_server(
        self, remote: canopen.RemoteNode, device: OurDevice
    ) -> None:
        remote.sdo.download(0x2000, 1, b"\x01\x02", force_segment=True)
        assert device.objects[0x2000, 1] == b"\x01\x02"

    def test_canopen_receives_our_abort_codes(self, remote: canopen.RemoteNode) -> None:
        with pytest.raises(canopen.SdoAbortedError) as unknown:
            remote.sdo.upload(0x3000, 0)
        with pytest.raises(canopen.SdoAbortedError) as read_only:
            remote.sdo.download(0x1000, 0, bytes(4))
        assert (unknown.value.code, read_only.value.code) == (0x0602_0000, 0x0601_0002)


def dictionary(objects: dict[tuple[int, int], tuple[int, int]]) -> canopen.ObjectDictionary:
    od = canopen.ObjectDictionary()
    for (index, subindex), (size, value) in objects.items():
        variable = ODVariable(f"{index:04X}:{subindex:02X}", index, subindex)
        variable.data_type = TYPES[size]
        variable.default = variable.value = value
        several = any(i == index and s for i, s in objects)
        if several:
            if index not in od:
                od.add_object(ODRecord(f"{index:04X}", index))
            record = od[index]
            assert isinstance(record, ODRecord)
            record.add_member(variable)
        else:
            od.add_object(variable)
    name = ODVariable("name", 0x1008, 0)
    name.data_type = VISIBLE_STRING
    name.default = name.value = "a drive made by the canopen package"  # type: ignore[assignment] # accepts text too
    od.add_object(name)
    return od


@pytest.fixture
def local(
    network: canopen.Network, default_objects: dict[tuple[int, int], tuple[int, int]]
) -> canopen.LocalNode:
    unused = {  # the package needs a mapping and a type for every PDO
        (mapping, sub): (1 if sub == 0 else 4, 0)
        for mapping in (0x1601, 0x1A01, 0x1A02)
        for sub in range(9)
    } | {(record, 2): (1, 255) for record in (0x1401, 0x1801, 0x1802)}
    node = canopen.LocalNode(NODE, dictionary(default_objects | unused))
    network.add_node(node)
    return node


def no_others(frame: Frame, time_s: float) -> None:
    pass


class TestCanopenAsServer:
    @pytest.fixture
    def port(self, local: canopen.LocalNode) -> Iterator[SdoPort]:
        with open_can(CanBusConfig(interface="virtual", channel=CHANNEL)) as link:
            yield SdoPort(link, NODE, no_others, timeout_s=30.0)

    def test_our_client_reads_from_canopen(self, port: SdoPort) -> None:
        assert port.read_int(0x1000, 0) == 0x0002_0192
        assert port.read(0x1008, 0) == b"a drive made by the canopen package"

    def test_our_client_writes_to_canopen(self, port: SdoPort, local: canopen.LocalNode) -> None:
        port.write(0x6060, 0, b"\x09")
        assert local.get_data(0x6060, 0) == b"\x09"
        port.write(0x1008, 0, b"a new and much longer name")
        assert port.read(0x1008, 0) == b"a new and much longer name"

    def test_our_client_receives_canopens_abort_codes(self, port: SdoPort) -> None:
        with raises_code(SdoAbort, "RID-DRIVE-REFUSED") as caught:
            port.read(0x3000, 0)
        assert caught.value.code == SdoCode.NO_OBJECT
        with raises_code(SdoAbort, "RID-DRIVE-REFUSED", "sub-index"):
            port.read(0x6091, 9)

    def test_a_complete_drive_is_configured_and_read_back(
        self, local: canopen.LocalNode, cell: CellConfig, robot: RobotDescription
    ) -> None:
        """The whole bring-up except the boot-up message, which a LocalNode does not send."""
        axis = cell.axes[1].model_copy(update={"node_id": NODE})
        with open_can(CanBusConfig(interface="virtual", channel=CHANNEL)) as link:
            result = DriveSetup(link, axis, robot.joints[0], cell, REACH, no_others).run()
        assert [s for s in result.settings if s.verdict == "red"] == []
        assert result.units is not None
        assert result.units.counts_per_rad == pytest.approx(65189.9, abs=0.1)
        local.rpdo.read()
        local.tpdo.read()
        assert [hex(v.index) for v in local.rpdo[1].map] == ["0x6040", "0x60ff"]
        assert [hex(v.index) for v in local.tpdo[1].map] == ["0x6041", "0x6064", "0x6077"]
        assert local.rpdo[1].enabled
        assert local.rpdo[1].cob_id == 0x205
        assert not local.rpdo[2].enabled
