"""Simulated drive on the bus: boot, SDO, NMT, PDOs and heartbeats are judged only by frames and
their times.
"""

from __future__ import annotations

from typing import Any

import pytest

from drivers.canopen.frames import SYNC, Frame
from drivers.servo.cia402 import PowerState, state_of
from mock_hw.drive.drive import BOOT_S, SYNC_ANSWER_S

Bench = Any
PRE_OPERATIONAL = 0x7F
OPERATIONAL = 0x05


def test_the_drive_sends_a_boot_up_message(bench: Bench) -> None:
    bench.run_to(BOOT_S - 1e-6)
    assert bench.take() == []
    bench.run_to(BOOT_S)
    ((time_s, frame),) = bench.take()
    assert (frame.cob_id, frame.data) == (0x703, b"\0")
    assert time_s == BOOT_S


def test_the_drive_ignores_frames_until_it_has_booted(bench: Bench) -> None:
    bench.receive(Frame(0x603, bytes.fromhex("4000100000000000")))
    bench.receive(Frame(0x000, b"\x01\x00"))
    assert bench.take() == []


def test_the_drive_states_its_identity_and_units(bench: Bench) -> None:
    bench.run_to(0.05)
    assert bench.read(0x1000) & 0xFFFF == 402
    assert bench.read(0x6502) == 1 << 8
    assert bench.read(0x608F, 1) == 4096
    assert (bench.read(0x6091, 1), bench.read(0x6091, 2)) == (100, 1)
    assert bench.read(0x6076) == 2000
    assert bench.read(0x1018, 4) == 3


@pytest.mark.parametrize(
    ("index", "subindex", "value", "size", "code"),
    [
        (0x2345, 0, 0, 1, 0x0602_0000),
        (0x1018, 9, 0, 1, 0x0609_0011),
        (0x1000, 0, 0, 4, 0x0601_0002),
        (0x6085, 0, 0, 2, 0x0607_0013),
        (0x6066, 0, 0, 4, 0x0607_0012),
        (0x605A, 0, 3, 2, 0x0609_0030),
        (0x6060, 0, 8, 1, 0x0609_0030),
        (0x1003, 0, 1, 1, 0x0609_0030),
    ],
)
def test_an_invalid_write_is_refused_with_its_abort_code(
    bench: Bench, index: int, subindex: int, value: int, size: int, code: int
) -> None:
    bench.run_to(0.05)
    assert bench.write(index, subindex, value, size) == code


@pytest.mark.parametrize(
    ("index", "subindex", "value", "size", "code"),
    [
        (0x1600, 0, 0, 1, 0x0601_0000),
        (0x1601, 1, 0x6041_0010, 4, 0x0604_0041),
        (0x1A01, 1, 0x6085_0020, 4, 0x0604_0041),
        (0x1A01, 1, 0x6041_0008, 4, 0x0604_0041),
        (0x1A01, 1, 0x2345_0008, 4, 0x0602_0000),
        (0x1800, 2, 250, 1, 0x0609_0030),
        (0x1800, 1, 0x203, 4, 0x0609_0030),
        (0x1801, 1, 0x2000_0283, 4, 0x0609_0030),
    ],
)
def test_pdo_records_can_be_changed_only_as_the_standard_allows(
    bench: Bench, index: int, subindex: int, value: int, size: int, code: int
) -> None:
    bench.run_to(0.05)
    assert bench.write(index, subindex, value, size) == code


def test_a_mapping_longer_than_a_frame_is_refused(bench: Bench) -> None:
    bench.run_to(0.05)
    for place in (1, 2, 3):
        assert bench.write(0x1A01, place, 0x6064_0020, 4) == 0
    assert bench.write(0x1A01, 0, 3, 1) == 0x0604_0042
    assert bench.write(0x1A01, 0, 2, 1) == 0


def test_mapped_objects_cannot_be_changed_singly(bench: Bench) -> None:
    bench.run_to(0.05)
    assert bench.write(0x1A01, 1, 0x6064_0020, 4) == 0
    assert bench.write(0x1A01, 0, 1, 1) == 0
    assert bench.write(0x1A01, 1, 0x6077_0010, 4) == 0x0601_0000


def test_long_texts_are_sent_in_segments(bench: Bench) -> None:
    bench.run_to(0.05)
    answer = bench.sdo(bytes.fromhex("40081000"))
    length = int.from_bytes(answer[4:], "little")
    text, toggle = b"", 0
    while len(text) < length:
        segment = bench.sdo(bytes((0x60 | toggle,)))
        text += segment[1 : 8 - (segment[0] >> 1 & 7)]
        toggle ^= 0x10
    assert text == b"rid-daq simulated servo drive"


def test_answers_take_some_time(bench: Bench) -> None:
    bench.configure()
    bench.run_for(0.01)
    bench.take()
    bench.receive(SYNC)
    ((time_s, _),) = bench.take(0x183)
    assert time_s == pytest.approx(bench.now_s + SYNC_ANSWER_S)


def test_heartbeats_contain_the_nmt_state(bench: Bench) -> None:
    bench.run_to(0.05)
    bench.write(0x1017, 0, 50, 2)
    bench.take()
    bench.run_for(0.149)
    beats = bench.take(0x703)
    assert [round(1000 * (beat[0] - beats[0][0])) for beat in beats] == [0, 50, 100]
    assert {beat[1].data[0] for beat in beats} == {PRE_OPERATIONAL}
    bench.receive(Frame(0, b"\x01\x03"))
    bench.run_for(0.05)
    assert bench.take(0x703)[-1][1].data[0] == OPERATIONAL


def test_process_data_is_exchanged_in_operational_only(bench: Bench) -> None:
    bench.configure()
    bench.receive(Frame(0, b"\x80\x03"))
    bench.receive(SYNC)
    assert bench.take(0x183) == []
    bench.receive(Frame(0, b"\x01\x03"))
    bench.receive(SYNC)
    assert len(bench.take(0x183)) == 1
    bench.receive(Frame(0, b"\x02\x00"))
    bench.receive(SYNC)
    bench.receive(Frame(0x603, bytes.fromhex("4000100000000000")))
    assert bench.take() == []


def test_nmt_commands_to_other_nodes_are_ignored(bench: Bench) -> None:
    bench.configure()
    bench.receive(Frame(0, b"\x80\x04"))
    bench.receive(SYNC)
    assert len(bench.take(0x183)) == 1


def test_set_points_act_at_the_next_sync(bench: Bench) -> None:
    bench.configure()
    bench.receive(Frame(0x203, bytes.fromhex("0600000000000000")))
    assert state_of(bench.read(0x6041)) is PowerState.SWITCH_ON_DISABLED
    bench.receive(SYNC)
    ((_, answer),) = bench.take(0x183)
    assert state_of(int.from_bytes(answer.data[:2], "little")) is PowerState.SWITCH_ON_DISABLED
    assert state_of(bench.read(0x6041)) is PowerState.READY_TO_SWITCH_ON


def test_an_event_driven_rpdo_acts_on_arrival(bench: Bench) -> None:
    bench.run_to(0.05)
    bench.receive(Frame(0, b"\x01\x00"))
    assert bench.drive.acts_on_arrival
    bench.receive(Frame(0x203, b"\x06\x00"))
    assert state_of(bench.read(0x6041)) is PowerState.READY_TO_SWITCH_ON


def test_an_event_driven_tpdo_is_sent_on_change_after_its_inhibit_time(bench: Bench) -> None:
    bench.run_to(0.05)
    bench.write(0x1800, 3, 200, 2)
    bench.receive(Frame(0, b"\x01\x00"))
    bench.run_for(0.001)
    assert len(bench.take(0x183)) == 1
    bench.receive(Frame(0x203, b"\x06\x00"))
    bench.receive(Frame(0x203, b"\x07\x00"))
    bench.run_for(0.018)
    assert bench.take(0x183) == []
    bench.run_for(0.002)
    ((_, frame),) = bench.take(0x183)
    assert state_of(int.from_bytes(frame.data, "little")) is PowerState.SWITCHED_ON
    bench.run_for(1.0)
    assert bench.take(0x183) == []


def test_an_event_timer_repeats_a_tpdo(bench: Bench) -> None:
    bench.run_to(0.05)
    bench.write(0x1800, 5, 10, 2)
    bench.receive(Frame(0, b"\x01\x00"))
    bench.run_for(0.0351)
    assert len(bench.take(0x183)) == 4


def test_a_tpdo_can_be_sent_at_every_nth_sync(bench: Bench) -> None:
    bench.configure()
    bench.write(0x1800, 2, 3, 1)
    bench.take()
    for _ in range(9):
        bench.receive(SYNC)
    assert len(bench.take(0x183)) == 3


def test_a_short_rpdo_is_refused_and_a_long_one_truncated(bench: Bench) -> None:
    bench.configure()
    bench.receive(Frame(0x203, b"\x06\x00"))
    bench.receive(SYNC)
    ((_, emergency),) = bench.take(0x083)
    assert emergency.data[:2] == (0x8210).to_bytes(2, "little")
    assert state_of(bench.read(0x6041)) is PowerState.SWITCH_ON_DISABLED
    bench.receive(Frame(0x203, bytes.fromhex("0600000000000000")))
    ((_, cleared),) = bench.take(0x083)
    assert cleared.data == bytes(8)


def test_a_reset_clears_the_configuration(bench: Bench) -> None:
    bench.configure(heartbeat_ms=80)
    bench.enable()
    bench.receive(Frame(0, b"\x82\x03"))
    assert bench.drive.power.state is PowerState.NOT_READY_TO_SWITCH_ON
    bench.take()
    bench.run_for(BOOT_S + 0.001)
    assert [frame.data for _, frame in bench.take(0x703)] == [b"\0"]
    assert bench.read(0x1016, 1) == 0
    assert bench.read(0x6060) == 9, "82h resets communication objects only"
    bench.receive(Frame(0, b"\x81\x03"))
    bench.run_for(BOOT_S + 0.001)
    assert bench.read(0x6060) == 0
