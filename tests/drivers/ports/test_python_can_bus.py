from __future__ import annotations

import pytest

from config.cell.cell import CanBusConfig
from config.errors import ConfigError, TransportError
from drivers.ports.can_link import open_can
from tests.builders.raised_codes import raises_code


def test_an_interface_that_nobody_knows_is_told_with_those_that_are_known() -> None:
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
def test_a_bus_that_is_not_there_is_named_with_what_to_check(interface: str, channel: str) -> None:
    names = (f"{interface}:{channel}", "can.interface", "can.channel")
    with raises_code(TransportError, "RID-CAN-OPEN", *names):
        open_can(CanBusConfig(interface=interface, channel=channel))


@pytest.mark.parametrize(
    "interface", ["pcan", "kvaser", "ixxat", "vector", "gs_usb", "usb2can", "systec", "neovi"]
)
def test_a_driver_library_that_is_missing_is_named_as_that(interface: str) -> None:
    with pytest.raises(TransportError) as caught:
        open_can(CanBusConfig(interface=interface, channel="0"))
    assert caught.value.refusal == "RID-CAN-LIBRARY"
