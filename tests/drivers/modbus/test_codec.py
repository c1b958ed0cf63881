"""Modbus registers and quantities: grouped requests, types, scaling, word order."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from config.cell.drive_profile import NAMEPLATE, POLLED, DriveProfile, Register
from config.errors import ProtocolError
from config.load import load_bundled_or_path
from drivers.modbus.codec import RegisterRead, decode, encode, plan_reads
from tests.builders.raised_codes import raises_code, raises_invalid


def profile(word_order: Any = "big", **registers: Register) -> DriveProfile:
    registers.setdefault(
        "motor_temperature_k", Register(address=0, type="int16", scale=0.1, offset=273.15)
    )
    return DriveProfile.model_validate(
        {"name": "test", "word_order": word_order, "registers": registers}
    )


class TestGroupedRequests:
    def test_neighbours_and_small_gaps_are_one_request(self) -> None:
        bundled = load_bundled_or_path("servo_registers", "profiles", DriveProfile)
        assert plan_reads(bundled, POLLED) == (RegisterRead("holding", 100, 4, POLLED),)
        (plates,) = plan_reads(bundled, NAMEPLATE)
        assert (plates.address, plates.count) == (200, 8)

    def test_a_large_gap_another_table_or_a_full_request_starts_a_new_one(self) -> None:
        drive = DriveProfile(
            name="test",
            most_registers=4,
            registers={
                "motor_temperature_k": Register(address=0, type="int16"),
                "operating_time_s": Register(address=3, type="uint32"),
                "rated_current_a": Register(address=40, type="uint16"),
                "rated_torque_nm": Register(address=1, type="uint16", table="input"),
            },
        )
        reads = plan_reads(drive, tuple(drive.registers))
        assert [(read.table, read.address, read.count) for read in reads] == [
            ("holding", 0, 1),
            ("holding", 3, 2),
            ("holding", 40, 1),
            ("input", 1, 1),
        ]

    def test_quantities_that_a_drive_lacks_are_not_requested(self) -> None:
        assert plan_reads(profile(), NAMEPLATE) == ()


class TestWordValues:
    """The words of each type were computed by hand, by IEEE 754 and two's complement."""

    @pytest.mark.parametrize(
        ("kind", "words", "value"),
        [
            ("uint16", (0xFFFF,), 65535.0),
            ("int16", (0xFFFE,), -2.0),
            ("uint32", (0x0001, 0x0002), 65538.0),
            ("int32", (0xFFFF, 0xFFFF), -1.0),
            ("float32", (0x3F66, 0x6666), 0.9),
            ("float32", (0xC2F7, 0x0000), -123.5),
        ],
    )
    def test_words_are_decoded_by_their_type(
        self, kind: Any, words: tuple[int, ...], value: float
    ) -> None:
        drive = profile(rated_torque_nm=Register(address=10, type=kind))
        read = RegisterRead("holding", 10, len(words), ("rated_torque_nm",))
        assert decode(drive, read, words)["rated_torque_nm"] == pytest.approx(value)
        reversed_order = profile("little", rated_torque_nm=Register(address=10, type=kind))
        swapped = tuple(reversed(words))
        assert decode(reversed_order, read, swapped)["rated_torque_nm"] == pytest.approx(value)

    def test_tenths_of_a_degree_celsius_are_converted_to_kelvin(self) -> None:
        (read,) = plan_reads(profile(), POLLED)
        assert decode(profile(), read, (654,))["motor_temperature_k"] == pytest.approx(338.55)
        assert decode(profile(), read, (0xFFCE,))["motor_temperature_k"] == pytest.approx(268.15)

    def test_too_few_words_are_refused(self) -> None:
        read = RegisterRead("holding", 0, 2, ("motor_temperature_k",))
        with raises_code(ProtocolError, "RID-MODBUS-GARBAGE"):
            decode(profile(), read, (1,))

    def test_a_value_that_is_not_a_number_is_reported_with_the_profile(self) -> None:
        drive = profile(rated_torque_nm=Register(address=10, type="float32"))
        read = RegisterRead("holding", 10, 2, ("rated_torque_nm",))
        with raises_code(ProtocolError, "RID-MODBUS-PROFILE", "10"):
            decode(drive, read, (0x7FC0, 0x0000))

    @pytest.mark.parametrize("order", ["big", "little"])
    def test_encoded_values_are_decoded_unchanged(self, order: Any) -> None:
        bundled = load_bundled_or_path("servo_registers", "profiles", DriveProfile)
        drive = bundled.model_copy(update={"word_order": order})
        values = dict.fromkeys(drive.registers, 0.0) | {
            "motor_temperature_k": 351.25,
            "operating_time_s": 123456.789,
            "torque_constant_nm_per_a": 0.9,
            "torque_constant_per_k": -0.00103,
            "reference_temperature_k": 298.15,
            "rated_current_a": 5.111,
            "rotor_inertia_kg_m2": 8e-5,
        }
        words = encode(drive, values)
        for read in plan_reads(drive, (*POLLED, *NAMEPLATE)):
            registers = [words.get(read.address + i, 0) for i in range(read.count)]
            for name, value in decode(drive, read, registers).items():
                assert value == pytest.approx(values[name], rel=1e-6, abs=0.05)

    def test_a_value_out_of_range_is_limited(self) -> None:
        assert encode(profile(), {"motor_temperature_k": 1e6}) == {0: 0x7FFF}
        assert encode(profile(), {"motor_temperature_k": -1e6}) == {0: 0x8000}


class TestInvalidProfiles:
    def test_overlapping_registers_are_refused(self) -> None:
        with raises_invalid("", "rated_torque_nm", "rated_current_a", "register 11"):
            profile(
                rated_torque_nm=Register(address=10, type="uint32"),
                rated_current_a=Register(address=11, type="uint16"),
            )

    def test_a_profile_without_temperature_is_refused(self) -> None:
        only = {"rated_torque_nm": Register(address=1, type="uint16")}
        with raises_invalid("", "motor_temperature_k"):
            DriveProfile(name="test", registers=only)  # type: ignore[arg-type]

    def test_a_scale_of_zero_is_refused(self) -> None:
        with raises_invalid("", "scale", "0"):
            Register(address=1, type="uint16", scale=0.0)

    def test_infinite_numbers_are_refused(self) -> None:
        with pytest.raises(ValidationError):
            Register(address=1, type="uint16", scale=math.inf)
