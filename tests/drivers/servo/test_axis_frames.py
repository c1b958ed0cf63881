"""Signals of a drive in several frames: commands are spread over frames, answers are collected from
frames.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.cell.servo_profile import ServoProfile
from config.load import load_bundled_or_path
from drivers.canopen.pdo import ON_EVENT
from drivers.ports.can_link import CanLink
from drivers.ports.can_ports import Arrival
from drivers.servo.axis_frames import ANSWER, JOINED_ANSWER, AnswerJoiner, AxisFrames
from drivers.servo.command_frames import SpreadCommands
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.requirements import cyclic_pdos
from tests.builders.raised_codes import raises_invalid

FIXED = load_bundled_or_path("faulhaber_mc3000", "servos", ServoProfile)
ASKED = load_bundled_or_path("trinamic_tmcm16xx", "servos", ServoProfile)
STATUS, TRACE = 0x181, 0x381


def test_commands_are_placed_in_the_fixed_pdos_with_their_constant_fields() -> None:
    commands = SpreadCommands([AxisFrames.of_profile(1, FIXED)], [0x000F])
    frames = [(cob_id, bytes(data)) for cob_id, data in commands.velocities([-300])]
    assert frames == [(0x201, b"\x0f\x00"), (0x301, b"\x93" + struct.pack("<i", -300))]
    frames = [(cob_id, bytes(data)) for cob_id, data in commands.words([0x0002], [0])]
    assert frames == [(0x201, b"\x02\x00"), (0x301, b"\x93\0\0\0\0")]


def test_a_standard_drive_keeps_its_frames_with_another_drive_on_the_bus() -> None:
    nodes = [AxisFrames.of_profile(1, FIXED), AxisFrames.of_profile(2, ServoProfile())]
    frames = SpreadCommands(nodes, [0x000F, 0x000F]).velocities([1, -2])
    assert [bytes(data) for cob_id, data in frames if cob_id == 0x202] == [
        struct.pack("<Hi", 0x000F, -2)
    ]


def test_rpdos_without_sync_act_on_reception() -> None:
    pdo = cyclic_pdos(1, "full", ASKED)[0]
    assert (pdo.direction, pdo.transmission_type) == ("rpdo", ON_EVENT)


class Bus:
    """A bus with received frames in batches, one batch per call."""

    def __init__(self, *batches: Sequence[Arrival]) -> None:
        self.batches = list(batches)

    def receive_all(self, until_s: float) -> Sequence[Arrival]:
        return self.batches.pop(0) if self.batches else ()


class Watch:
    def __init__(self) -> None:
        self.short: list[tuple[int, int]] = []

    def wrong_length(self, axis: int, data_bytes: int, now_s: float, mapped: int = 8) -> None:
        self.short.append((axis, data_bytes))


def join_frames(profile: ServoProfile, *batches: Sequence[Arrival]) -> tuple[list[Arrival], Watch]:
    """Return the joined answers of one drive in a cycle with its SYNC at 1 s, and the watch."""
    bus, watch = Bus(*batches), Watch()
    frames = [AxisFrames.of_profile(1, profile)]
    joiner = AnswerJoiner(cast(CanLink, bus), [1], frames, cast(DriveWatch, watch))
    joiner.begin(1.0)
    joined: list[Arrival] = []
    while bus.batches:
        joined += joiner.receive_all(2.0)
    return joined, watch


def status_frame(time_s: float, word: int = 0x27) -> Arrival:
    return Arrival(STATUS, struct.pack("<H", word), time_s)


def trace_frame(time_s: float, counts: int = -70_000, current: int = -5) -> Arrival:
    return Arrival(TRACE, struct.pack("<ii", counts, current), time_s)


ANSWER_DATA = JOINED_ANSWER.pack(0x27, -70_000, -5, 0)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_parts_in_any_order_are_one_answer_with_the_oldest_time(order: tuple[int, int]) -> None:
    parts = [status_frame(1.001 + 0.001 * order[0]), trace_frame(1.001 + 0.001 * order[1])]
    parts.sort(key=lambda part: part.time_s)
    joined, _ = join_frames(FIXED, [parts[0]], [parts[1]])
    assert joined == [Arrival(STATUS, ANSWER_DATA, 1.001)]


def test_a_part_alone_is_not_an_answer() -> None:
    assert join_frames(FIXED, [status_frame(1.001)])[0] == []
    assert join_frames(FIXED, [trace_frame(1.001)])[0] == []


def test_a_16_bit_current_may_lack_its_upper_half() -> None:
    short = Arrival(TRACE, struct.pack("<ih", -70_000, -5), 1.001)
    assert [each.data for each in join_frames(FIXED, [status_frame(1.001), short])[0]] == [
        ANSWER_DATA
    ]


def test_a_part_that_is_too_short_is_reported_and_not_used() -> None:
    joined, watch = join_frames(FIXED, [status_frame(1.001), Arrival(TRACE, bytes(5), 1.001)])
    assert (joined, watch.short) == ([], [(0, 5)])


def test_a_part_from_before_sync_is_not_joined_with_a_later_one() -> None:
    assert join_frames(FIXED, [status_frame(0.999), trace_frame(1.001)])[0] == []
    late = join_frames(
        FIXED, [status_frame(0.998), trace_frame(0.999), status_frame(1.001), trace_frame(1.001)]
    )[0]
    assert [each.time_s for each in late] == [0.998, 1.001]


@pytest.mark.parametrize("after", [False, True])
def test_a_repeated_part_gives_a_second_answer(after: bool) -> None:
    again = status_frame(1.0005, word=0x1627)
    batch = [status_frame(1.0), trace_frame(1.001)]
    batch.insert(2 if after else 1, again)
    joined = join_frames(FIXED, batch)[0]
    assert [JOINED_ANSWER.unpack(each.data)[0] for each in joined] == [0x27, 0x1627]


def test_other_frames_are_returned_unchanged() -> None:
    other = Arrival(0x701, b"\x05", 1.001)
    assert join_frames(FIXED, [other])[0] == [other]


def sdo_answer(data: bytes, time_s: float = 1.002) -> Arrival:
    return Arrival(0x581, data, time_s)


POSITION = Arrival(0x181, struct.pack("<Hi", 0x27, -70_000), 1.001)


def test_a_requested_torque_is_joined_with_the_position() -> None:
    frames = [AxisFrames.of_profile(1, ASKED)]
    joiner = AnswerJoiner(cast(CanLink, Bus()), [1], frames, cast(DriveWatch, Watch()))
    assert joiner.requests == [(0x601, b"\x40\x77\x60\0\0\0\0\0")]
    answer = sdo_answer(b"\x43\x77\x60\0" + struct.pack("<i", -5))
    assert [each.data for each in join_frames(ASKED, [POSITION, answer])[0]] == [ANSWER_DATA]


@pytest.mark.parametrize(
    "data",
    [
        b"\x80\x77\x60\0\0\0\x02\x06",  # an abort
        b"\x43\x78\x60\0\0\0\0\0",  # another object
        b"\x4b\x77\x60\0\0\0\0\0",  # 16 bits of 32
        b"\x41\x77\x60\0\x08\0\0\0",  # segments
        b"\x43\x77\x60",
        b"\x43\x77\x60\0" + struct.pack("<i", 40_000),  # more than 16 bits are recorded
    ],
)
def test_an_answer_other_than_the_torque_is_not_joined(data: bytes) -> None:
    joined = join_frames(ASKED, [POSITION, sdo_answer(data)])[0]
    assert [each for each in joined if each.cob_id == 0x181] == []


def test_endless_parts_are_not_joined() -> None:
    joined, _ = join_frames(FIXED, *([status_frame(1.001)] for _ in range(3000)))
    assert joined == []


@pytest.mark.parametrize("profile", [FIXED, ASKED])
def test_the_bytes_of_a_cycle_are_counted(profile: ServoProfile) -> None:
    frames: Any = AxisFrames.of_profile(1, profile)
    wanted = ((2, 5), (2, 6, 8)) if profile is FIXED else ((6, 8), (6, 8))
    assert (frames.sent_bytes, frames.answer_bytes) == wanted


arrivals = st.builds(
    Arrival, st.sampled_from([0x181, 0x281, 0x381, 0x581, 0x701]), st.binary(max_size=8),
    st.floats(0.9, 1.1),
)  # fmt: skip


@settings(max_examples=100)
@given(strange=st.lists(arrivals, max_size=20), profile=st.sampled_from([FIXED, ASKED]))
def test_any_frames_become_answers_at_most_once_or_are_returned_unchanged(
    strange: list[Arrival], profile: ServoProfile
) -> None:
    joined, watch = join_frames(profile, strange)
    answers = [each for each in joined if each.cob_id == STATUS]
    assert len(joined) + len(watch.short) <= len(strange)
    assert all(len(each.data) == JOINED_ANSWER.size for each in answers)
    stamps = {each.time_s for each in strange}
    assert all(each.time_s in stamps for each in answers), (
        "an answer must have the arrival time of one of its parts"
    )


class TestDigitalInputs:
    """A drive with `digital_inputs` sends 60FDh in TPDO 2 at every SYNC."""

    PROFILE = ServoProfile(digital_inputs=True)

    def test_they_have_a_pdo_of_their_own(self) -> None:
        pdo = cyclic_pdos(1, "full", self.PROFILE)[2]
        assert (pdo.direction, pdo.number, pdo.transmission_type) == ("tpdo", 2, 1)
        assert [(item.index, item.bits) for item in pdo.objects] == [(0x60FD, 32)]

    def test_an_answer_is_complete_with_the_inputs_of_its_cycle(self) -> None:
        answer = Arrival(0x181, ANSWER.pack(0x27, 5, -6), 1.001)
        inputs = Arrival(0x281, struct.pack("<I", 1 << 16), 1.002)
        joined, _ = join_frames(self.PROFILE, [answer], [inputs])
        assert joined == [Arrival(0x181, JOINED_ANSWER.pack(0x27, 5, -6, 1 << 16), 1.001)]
        assert join_frames(self.PROFILE, [answer])[0] == []
        old = inputs._replace(time_s=0.999)
        assert join_frames(self.PROFILE, [old], [answer])[0] == []

    def test_fixed_pdos_must_carry_them_as_a_signal(self) -> None:
        with raises_invalid("", "digital_inputs"):
            ServoProfile(digital_inputs=True, pdos=FIXED.pdos, mode=FIXED.mode, torque=FIXED.torque)
        assert not FIXED.sends_inputs
