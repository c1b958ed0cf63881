"""Bus arbitration: one frame at a time, lowest identifier first, each for its exact time."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from mock_hw.bus.arbitration import FOREVER_NS, CanWire, WireFrame
from mock_hw.bus.wire_time import wire_bits


def frame(can_id: int, time_ns: int = 0, data: bytes = b"") -> WireFrame:
    return WireFrame(time_ns, can_id, len(data), 0, data)


def run(wire: CanWire) -> list[WireFrame]:
    delivered = []
    while wire.next_ns < FOREVER_NS:
        delivery = wire.step()
        if delivery is not None:
            delivered.append(delivery.frame)
    return delivered


def test_a_silent_bus_has_no_next_event() -> None:
    assert CanWire(1_000_000).next_ns == FOREVER_NS


def test_a_frame_arrives_with_its_last_bit() -> None:
    wire = CanWire(500_000)
    wire.queue((0, 0), frame(0x80, 10_000), 0)
    (arrived,) = run(wire)
    assert arrived.time_ns == 10_000 + (51 - 3) * 2_000


def test_the_lowest_waiting_identifier_is_sent_first() -> None:
    wire = CanWire(1_000_000)
    for source, can_id in enumerate((0x701, 0x183, 0x182, 0x000)):
        wire.queue((source, 0), frame(can_id), 0)
    assert [f.can_id for f in run(wire)] == [0x000, 0x182, 0x183, 0x701]


def test_a_source_sends_in_its_queue_order() -> None:
    wire = CanWire(1_000_000)
    for can_id in (0x601, 0x000, 0x080):
        wire.queue((1, 0), frame(can_id), 0)
    wire.queue((2, 0), frame(0x300), 0)
    assert [f.can_id for f in run(wire)] == [0x300, 0x601, 0x000, 0x080]


def test_a_frame_on_the_wire_is_not_interrupted() -> None:
    wire = CanWire(1_000_000)
    wire.queue((1, 0), frame(0x7FF, 0, bytes(8)), 0)
    wire.step()
    wire.queue((2, 0), frame(0x000, 20_000), 20_000)
    low, high = run(wire)
    assert (low.can_id, high.can_id) == (0x7FF, 0x000)
    begin_ns = wire_bits(0x7FF, bytes(8)) * 1000
    assert high.time_ns == begin_ns + (wire_bits(0x000, b"") - 3) * 1000


def test_a_frame_is_never_sent_before_its_time_nor_in_the_past() -> None:
    wire = CanWire(1_000_000)
    wire.queue((1, 0), frame(0x100, 5_000_000), 0)
    wire.queue((2, 0), frame(0x200, 1_000), 2_000_000)
    early, late = run(wire)
    assert early.can_id == 0x200
    assert early.time_ns > 2_000_000
    assert late.time_ns > 5_000_000


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.integers(0, 0x7FF), st.integers(0, 10**7), st.binary(max_size=8)
        ),
        max_size=40,
    )
)
def test_no_frame_is_lost_and_frames_never_overlap(
    queued: list[tuple[int, int, int, bytes]],
) -> None:
    wire = CanWire(1_000_000)
    for source, can_id, time_ns, data in queued:
        wire.queue((source, 0), frame(can_id, time_ns, data), 0)
    delivered = run(wire)
    assert sorted((f.can_id, f.data) for f in delivered) == sorted((i, d) for _, i, _, d in queued)
    end_ns = 0
    for f in delivered:
        bits = wire_bits(f.can_id, f.data[: f.length])
        assert f.time_ns - (bits - 3) * 1000 >= end_ns
        end_ns = f.time_ns + 3000
