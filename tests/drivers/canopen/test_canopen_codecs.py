"""Byte-exact frames of NMT, heartbeat, EMCY and PDO configuration, by the clauses of CiA 301."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ProtocolError
from drivers.canopen.emcy import Emergency, code_text, emcy_frame, parse_emcy
from drivers.canopen.frames import Frame, rpdo_cob_id, tpdo_cob_id
from drivers.canopen.heartbeat import (
    HeartbeatConsumer,
    HeartbeatProducer,
    consumer_entry,
    guard_answer,
    guard_request,
    heartbeat_frame,
    parse_consumer_entry,
)
from drivers.canopen.nmt import (
    NmtCommand,
    NmtState,
    next_nmt_state,
    nmt_frame,
    parse_nmt,
    state_name,
)
from drivers.canopen.pdo import MappedObject, PdoMapping, is_valid, split
from drivers.device_text import printable
from tests.builders.raised_codes import raises_code


class TestIdentifiers:
    """CiA 301, 7.3.3, table 42: the predefined connection set."""

    def test_pdo_identifiers_follow_the_predefined_connection_set(self) -> None:
        assert [tpdo_cob_id(3, n) for n in (1, 2, 3, 4)] == [0x183, 0x283, 0x383, 0x483]
        assert [rpdo_cob_id(3, n) for n in (1, 2, 3, 4)] == [0x203, 0x303, 0x403, 0x503]

    def test_a_frame_is_written_as_by_candump(self) -> None:
        assert str(Frame(0x181, b"\x37\x06")) == "181#3706"


class TestNmt:
    def test_reset_communication_of_node_5(self) -> None:
        # CiA 301, 7.2.8.2.1: identifier 0, command specifier, node id
        assert nmt_frame(NmtCommand.RESET_COMMUNICATION, 5) == Frame(0, b"\x82\x05")

    def test_start_of_all_nodes(self) -> None:
        assert nmt_frame(NmtCommand.START) == Frame(0, b"\x01\x00")

    @pytest.mark.parametrize(
        ("frame", "command"),
        [
            (Frame(0, b"\x01\x05"), NmtCommand.START),
            (Frame(0, b"\x80\x00"), NmtCommand.ENTER_PRE_OPERATIONAL),
            (Frame(0, b"\x01\x06"), None),
            (Frame(0, b"\x33\x05"), None),
            (Frame(0, b"\x01"), None),
            (Frame(1, b"\x01\x05"), None),
        ],
    )
    def test_a_node_follows_only_commands_to_it_or_to_all(
        self, frame: Frame, command: NmtCommand | None
    ) -> None:
        assert parse_nmt(frame, 5) is command

    def test_nmt_state_machine(self) -> None:
        assert next_nmt_state(NmtState.PRE_OPERATIONAL, NmtCommand.START) is NmtState.OPERATIONAL
        assert next_nmt_state(NmtState.OPERATIONAL, NmtCommand.STOP) is NmtState.STOPPED
        assert next_nmt_state(NmtState.INITIALISING, NmtCommand.START) is NmtState.INITIALISING

    def test_states_have_names(self) -> None:
        assert state_name(0x85) == "operational"
        assert state_name(0x11) == "unknown state 11h"


class TestHeartbeat:
    def test_boot_up_and_heartbeat_frames(self) -> None:
        # CiA 301, 7.2.8.3.3 and 7.2.8.3.2
        assert heartbeat_frame(2, NmtState.INITIALISING) == Frame(0x702, b"\x00")
        assert heartbeat_frame(127, NmtState.OPERATIONAL) == Frame(0x77F, b"\x05")

    def test_the_consumer_heartbeat_entry_has_node_id_and_time(self) -> None:
        # CiA 301, 7.5.2.17, figure 64: node id in bits 16-23, time in bits 0-15
        assert consumer_entry(127, 80) == 0x007F_0050
        assert parse_consumer_entry(0x007F_0050) == (127, 0.08)
        assert parse_consumer_entry(0x0000_0050) is None
        assert parse_consumer_entry(0x007F_0000) is None

    def test_the_producer_never_sends_missed_heartbeats_later(self) -> None:
        producer = HeartbeatProducer(0.025)
        assert [producer.due(t) for t in (1.0, 1.024, 1.025)] == [True, False, True]
        assert producer.due(2.0), "one heartbeat after a long pause"
        assert not producer.due(2.001), "and no more"

    def test_the_consumer_starts_with_the_first_heartbeat(self) -> None:
        # CiA 301, 7.2.8.3.2
        consumer = HeartbeatConsumer(0.1)
        assert not consumer.has_expired(100.0)
        consumer.note_heartbeat(5, 100.0)
        assert not consumer.has_expired(100.1)
        assert consumer.has_expired(100.101)
        assert not consumer.has_expired(100.2), "a loss is reported once"
        assert consumer.lost
        consumer.note_heartbeat(5, 100.3)
        assert not consumer.lost

    def test_a_guarded_node_is_alive_while_its_toggle_bit_alternates(self) -> None:
        # CiA 301, 7.2.8.3.1
        assert guard_request(3) == (0x4000_0703, b"\0")
        assert guard_answer(3, NmtState.OPERATIONAL, True) == (0x703, b"\x85")
        consumer = HeartbeatConsumer(0.1, guarded=True)
        for number, time_s in enumerate((1.0, 1.05, 1.1, 1.15)):
            consumer.note_heartbeat(5, time_s, 0x80 * (number % 2))
            assert not consumer.has_expired(time_s + 0.09)
        consumer.note_heartbeat(5, 1.2, 0x80)
        assert consumer.has_expired(1.251), "a repeated answer does not count"


class TestEmergency:
    def test_a_following_error_frame_is_encoded_and_decoded(self) -> None:
        # CiA 301, 7.2.7.3: error code, error register, five bytes of the manufacturer
        emergency = Emergency(0x8611, 0x21, b"\1\2\3\4\5")
        frame = Frame(0x083, bytes.fromhex("11 86 21 01 02 03 04 05"))
        assert emcy_frame(3, emergency) == frame
        assert parse_emcy(frame.data) == emergency
        assert str(emergency) == (
            "following error (EMCY 8611h, 1001h=21h, vendor bytes 0102030405)"
        )

    @pytest.mark.parametrize(
        ("code", "text"),
        [
            (0x8130, "heartbeat of the master lost"),
            (0x2399, "current error at the output"),
            (0x5441, "hardware error"),
            (0xFF07, "manufacturer's error"),
            (0xB123, "unknown error"),
            (0, "error reset, no error"),
        ],
    )
    def test_error_codes_have_descriptions(self, code: int, text: str) -> None:
        assert code_text(code) == text

    @given(st.binary(max_size=8))
    def test_any_emergency_frame_is_decoded(self, data: bytes) -> None:
        assert str(parse_emcy(data)).isprintable()


class TestPdo:
    VELOCITY = PdoMapping(
        "rpdo",
        1,
        0x203,
        (MappedObject(0x6040, 0, 16), MappedObject(0x60FF, 0, 32), MappedObject(0x60B2, 0, 16)),
    )

    def test_the_order_of_configuration_writes(self) -> None:
        # CiA 301, 7.5.2.36: off, mapping off, entries, mapping on, type, and valid again
        written = [(w.index, w.subindex, w.data.hex()) for w in self.VELOCITY.writes()]
        assert written == [
            (0x1400, 1, "03020080"),
            (0x1600, 0, "00"),
            (0x1600, 1, "10004060"),
            (0x1600, 2, "2000ff60"),
            (0x1600, 3, "1000b260"),
            (0x1600, 0, "03"),
            (0x1400, 2, "01"),
            (0x1400, 1, "03020000"),
        ]

    def test_a_tpdo_does_not_allow_remote_frames(self) -> None:
        pdo = PdoMapping("tpdo", 2, 0x283, (MappedObject(0x606C, 0, 32),), 10)
        *_, last = pdo.writes()
        assert (last.index, last.subindex, last.data.hex()) == (0x1801, 1, "83020040")

    def test_a_mapping_longer_than_a_frame_is_refused(self) -> None:
        with raises_code(ProtocolError, "RID-DRIVE-DATA-SIZE", "96"):
            PdoMapping("tpdo", 1, 0x181, (MappedObject(0x6064, 0, 32),) * 3)

    @given(st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.integers(0, 0xFF))
    def test_entries_are_encoded_and_decoded_unchanged(
        self, index: int, subindex: int, bits: int
    ) -> None:
        item = MappedObject(index, subindex, bits)
        assert MappedObject.parse(item.entry()) == item

    def test_a_frame_is_split_by_its_mapping(self) -> None:
        assert split(self.VELOCITY.objects, bytes(range(8))) == [b"\0\1", b"\2\3\4\5", b"\6\7"]
        with raises_code(ProtocolError, "RID-DRIVE-DATA-SIZE"):
            split(self.VELOCITY.objects, bytes(5))

    def test_bit_31_disables_a_pdo(self) -> None:
        assert is_valid(0x4000_0181)
        assert not is_valid(0x8000_0181)


class TestDeviceText:
    def test_control_characters_cannot_reach_the_terminal(self) -> None:
        assert printable(b"servo\x1b[2J\x00\n") == r"servo\x1b[2J\x00\n"

    def test_escape_sequences_cannot_be_forged(self) -> None:
        assert printable("a\\x1b") == "a\\\\x1b"

    def test_long_text_is_truncated(self) -> None:
        assert printable("x" * 100, limit=5) == "xxxxx..."

    @given(st.one_of(st.text(), st.binary()))
    def test_any_text_becomes_printable(self, text: str | bytes) -> None:
        assert printable(text).isprintable()
