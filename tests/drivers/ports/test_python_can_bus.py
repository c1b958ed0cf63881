from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from config.cell.cell import CanBusConfig
from config.errors import ConfigError, TransportError
from drivers.ports.can_link import open_can
from drivers.ports.can_ports import Arrival
from mock_hw.bus.lawicel_port import LawicelPort
from tests.builders.raised_codes import raises_code

PATIENCE_S = 60.0  # time within which frames arrive, even on a busy computer


def test_frames_left_by_a_dead_program_on_an_slcan_channel_are_not_read(
    tmp_path: Path,
) -> None:
    adapter = LawicelPort(tmp_path / "adapter", 1_000_000)
    left_open = os.open(tmp_path / "adapter", os.O_RDWR | os.O_NOCTTY)
    old, new = (0x181, bytes(range(0xA0, 0xA8))), (0x182, bytes(range(0xB0, 0xB8)))
    os.write(left_open, b"S8\rO\r")
    adapter.receive_frames(10.0)
    for _ in range(5000):  # more than the kernel buffers
        adapter.send_frames([old])
    os.close(left_open)
    ended = threading.Event()

    def send_for_ever() -> None:
        while not ended.is_set():
            adapter.receive_frames(0.001)
            adapter.send_frames([new])

    sender = threading.Thread(target=send_for_ever)
    sender.start()
    try:
        link = open_can(CanBusConfig(interface="slcan", channel=str(tmp_path / "adapter")))
        until_s = link.clock.now_s() + PATIENCE_S
        arrived: list[Arrival] = []
        while len(arrived) <= 10 and link.clock.now_s() < until_s:
            arrived += link.receive_all(until_s)
        link.close()
    finally:
        ended.set()
        sender.join()
        adapter.shutdown()
    assert len(arrived) > 10
    assert {(one.cob_id, bytes(one.data)) for one in arrived} == {new}


def test_an_unknown_interface_is_refused_with_the_known_ones() -> None:
    names = ("can.interface: ", "'socketcann'", "socketcan?", ", pcan, rid_sim, ")
    with raises_code(ConfigError, "RID-CAN-INTERFACE", *names):
        open_can(CanBusConfig(interface="socketcann", channel="can0"))


@pytest.mark.parametrize(
    ("interface", "channel"),
    [
        ("slcan", "/nowhere/ttyACM0"),
        ("socketcan", "nocan9"),
        ("socketcan", "a name that is too long"),
        ("socketcan", "with\0null"),
        ("udp_multicast", "239.0.0.1@port"),
    ],
)
def test_a_missing_bus_is_reported_with_what_to_check(interface: str, channel: str) -> None:
    names = (f"{interface}:{channel}", "can.interface", "can.channel")
    with raises_code(TransportError, "RID-CAN-OPEN", *names):
        open_can(CanBusConfig(interface=interface, channel=channel))


@pytest.mark.parametrize("channel", ["can0", "can0@10.0.0.7", "@10.0.0.7:29536", "can0@:29536"])
def test_a_socketcand_channel_names_the_computer_and_its_port(channel: str) -> None:
    with raises_code(ConfigError, "RID-CAN-INTERFACE", "can.channel", "can0@192.168.1.5:29536"):
        open_can(CanBusConfig(interface="socketcand", channel=channel))


@pytest.mark.parametrize(
    "interface", ["pcan", "kvaser", "ixxat", "vector", "gs_usb", "usb2can", "systec", "neovi"]
)
def test_a_missing_driver_library_is_reported_as_such(interface: str) -> None:
    with pytest.raises(TransportError) as caught:
        open_can(CanBusConfig(interface=interface, channel="0"))
    assert caught.value.refusal == "RID-CAN-LIBRARY"
