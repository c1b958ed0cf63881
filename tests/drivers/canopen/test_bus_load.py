"""The bit-exact length of CAN frames (ISO 11898-1) and the load that follows from it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.bus_load import cyclic_load, frame_bits, typical_bits, worst_bits
from drivers.canopen.frames import SYNC, Frame

frames = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


def bits_by_the_standard(frame: Frame) -> int:
    """Count the bits as the standard describes it: a bit string with stuff bits inserted."""
    header = f"0{frame.cob_id:011b}000{len(frame.data):04b}"
    payload = header + "".join(f"{byte:08b}" for byte in frame.data)
    crc = 0
    for bit in payload:
        feedback = int(bit) ^ (crc >> 14 & 1)
        crc = crc << 1 & 0x7FFF
        if feedback:
            crc ^= 0x4599
    stuffed = ""
    for bit in payload + f"{crc:015b}":
        stuffed += bit
        if stuffed[-5:] in ("00000", "11111"):
            stuffed += "1" if bit == "0" else "0"
    return len(stuffed) + 1 + 2 + 7 + 3


@given(frames)
def test_every_frame_has_the_length_of_the_standard(frame: Frame) -> None:
    assert frame_bits(frame) == bits_by_the_standard(frame)


@given(frames)
def test_no_frame_is_longer_than_the_worst_case(frame: Frame) -> None:
    unstuffed = 47 + 8 * len(frame.data)
    assert unstuffed <= frame_bits(frame) <= worst_bits(len(frame.data))


def test_known_frames_have_their_known_length() -> None:
    assert frame_bits(SYNC) == 51
    assert worst_bits(8) == 135
    assert typical_bits(8) == 119
    assert frame_bits(Frame(0x181, bytes.fromhex("3716a0860100f4ff"))) == 118


@pytest.mark.parametrize(
    ("axes", "cycle_s", "percent"),
    [(3, 0.001, 77), (4, 0.001, 101), (6, 0.002, 75), (3, 0.008, 10)],
)
def test_the_load_of_a_cycle(axes: int, cycle_s: float, percent: int) -> None:
    load = cyclic_load(axes, cycle_s, 10**6, heartbeats_s=(0.025, 0.05))
    assert round(100 * load) == percent
    worst = cyclic_load(axes, cycle_s, 10**6, heartbeats_s=(0.025, 0.05), worst=True)
    assert load < worst < 1.2 * load
