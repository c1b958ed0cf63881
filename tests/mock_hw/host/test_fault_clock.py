"""Cycles of a fault script count from the controlword Enable Operation, in every layout of PDOs."""

from __future__ import annotations

import struct

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from drivers.canopen.frames import SYNC_COB_ID, rpdo_cob_id
from mock_hw.host.fault_clock import CycleCount, controlword_places
from tests.mock_hw.test_families import bundled, cell_of

NODE = 1


def count_of(cell: CellConfig) -> CycleCount:
    return CycleCount(controlword_places(cell))


def test_a_set_point_of_the_trimmed_exchange_is_no_controlword() -> None:
    cell = cell_of(ServoProfile(), ServoProfile()).model_copy(update={"exchange": "trimmed"})
    count = count_of(cell)
    for velocity in (0x0F, 0):  # as a word: Enable Operation, then Disable Voltage
        count.observe(rpdo_cob_id(NODE), struct.pack("<i", velocity))
        count.observe(SYNC_COB_ID, b"")
    assert count.cycle == 0
    count.observe(rpdo_cob_id(NODE, 2), b"\x0f\x00")
    for _ in range(3):
        count.observe(rpdo_cob_id(NODE), struct.pack("<i", 0))
        count.observe(SYNC_COB_ID, b"")
    assert count.cycle == 3
    count.observe(rpdo_cob_id(NODE, 2), b"\x00\x00")
    assert count.cycle == 0


@pytest.mark.parametrize(
    ("profile", "frame"),
    [
        (ServoProfile(), struct.pack("<Hi", 0x0F, 0)),
        (ServoProfile(mode="interpolated_position"), struct.pack("<Hi", 0x1F, 0)),
        (bundled("faulhaber_mc3000"), b"\x0f\x00"),
    ],
    ids=["cia402", "interpolated", "fixed_pdos"],
)
def test_each_family_s_enabling_controlword_begins_the_count(
    profile: ServoProfile, frame: bytes
) -> None:
    count = count_of(cell_of(profile, profile))
    count.observe(SYNC_COB_ID, b"")
    assert count.cycle == 0
    count.observe(rpdo_cob_id(NODE), frame)
    count.observe(SYNC_COB_ID, b"")
    assert count.cycle == 1
