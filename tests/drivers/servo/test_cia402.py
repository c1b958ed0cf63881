"""Power state machine and units of CiA 402-2."""

from __future__ import annotations

import math
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.cell.servo_profile import ServoProfile, VelocityUnit
from config.errors import ConfigError
from drivers.servo.cia402 import (
    AxisUnits,
    ControlWord,
    MotorRatings,
    PowerState,
    after_controlword,
    next_controlword,
    state_of,
)
from tests.builders.raised_codes import raises_code

S = PowerState
W = ControlWord


@pytest.mark.parametrize(
    ("statusword", "state"),
    [
        # CiA 402-2, table 31: xxxx xxxx x0xx 0000 and so on; real words with voltage and remote set
        (0x0000, S.NOT_READY_TO_SWITCH_ON),
        (0x0250, S.SWITCH_ON_DISABLED),
        (0x0270, S.SWITCH_ON_DISABLED),
        (0x0231, S.READY_TO_SWITCH_ON),
        (0x0233, S.SWITCHED_ON),
        (0x1637, S.OPERATION_ENABLED),
        (0x0217, S.QUICK_STOP_ACTIVE),
        (0x021F, S.FAULT_REACTION_ACTIVE),
        (0x023F, S.FAULT_REACTION_ACTIVE),
        (0x0218, S.FAULT),
        (0x0238, S.FAULT),
    ],
)
def test_status_words_are_decoded_to_their_state(statusword: int, state: PowerState) -> None:
    assert state_of(statusword) is state


@given(st.integers(0, 0xFFFF))
def test_every_statusword_has_one_state(statusword: int) -> None:
    patterns = {
        S.NOT_READY_TO_SWITCH_ON: 0x4F, S.SWITCH_ON_DISABLED: 0x4F, S.READY_TO_SWITCH_ON: 0x6F,
        S.SWITCHED_ON: 0x6F, S.OPERATION_ENABLED: 0x6F, S.QUICK_STOP_ACTIVE: 0x6F,
        S.FAULT_REACTION_ACTIVE: 0x4F, S.FAULT: 0x4F,
    }  # fmt: skip
    matching = [state for state, mask in patterns.items() if statusword & mask == state]
    assert [state_of(statusword)] == (matching or [S.NOT_READY_TO_SWITCH_ON])


def test_the_commands_to_operation_enabled() -> None:
    state, words = S.SWITCH_ON_DISABLED, [0]
    while state is not S.OPERATION_ENABLED:
        words.append(next_controlword(state))
        state = after_controlword(state, words[-1], words[-2])
    assert words == [0, 0x0006, 0x0007, 0x000F]


def test_a_fault_is_never_reset_during_enabling() -> None:
    assert next_controlword(S.FAULT) is W.DISABLE_VOLTAGE
    assert next_controlword(S.FAULT_REACTION_ACTIVE) is W.DISABLE_VOLTAGE


@pytest.mark.parametrize(
    ("state", "word", "after"),
    [
        # the transitions of CiA 402-2, figure 9, by number
        (S.SWITCH_ON_DISABLED, W.SHUTDOWN, S.READY_TO_SWITCH_ON),  # 2
        (S.READY_TO_SWITCH_ON, W.SWITCH_ON, S.SWITCHED_ON),  # 3
        (S.SWITCHED_ON, W.ENABLE_OPERATION, S.OPERATION_ENABLED),  # 4
        (S.OPERATION_ENABLED, W.SWITCH_ON, S.SWITCHED_ON),  # 5
        (S.SWITCHED_ON, W.SHUTDOWN, S.READY_TO_SWITCH_ON),  # 6
        (S.READY_TO_SWITCH_ON, W.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),  # 7
        (S.READY_TO_SWITCH_ON, W.QUICK_STOP, S.SWITCH_ON_DISABLED),  # 7
        (S.OPERATION_ENABLED, W.SHUTDOWN, S.READY_TO_SWITCH_ON),  # 8
        (S.OPERATION_ENABLED, W.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),  # 9
        (S.SWITCHED_ON, W.QUICK_STOP, S.SWITCH_ON_DISABLED),  # 10
        (S.OPERATION_ENABLED, W.QUICK_STOP, S.QUICK_STOP_ACTIVE),  # 11
        (S.QUICK_STOP_ACTIVE, W.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),  # 12
        (S.QUICK_STOP_ACTIVE, W.ENABLE_OPERATION, S.OPERATION_ENABLED),  # 16
        # no transition: shutdown must be first
        (S.SWITCH_ON_DISABLED, W.SWITCH_ON, S.SWITCH_ON_DISABLED),
        (S.SWITCH_ON_DISABLED, W.ENABLE_OPERATION, S.SWITCH_ON_DISABLED),
        (S.QUICK_STOP_ACTIVE, W.QUICK_STOP, S.QUICK_STOP_ACTIVE),
        (S.QUICK_STOP_ACTIVE, W.SHUTDOWN, S.QUICK_STOP_ACTIVE),
        (S.NOT_READY_TO_SWITCH_ON, W.SHUTDOWN, S.NOT_READY_TO_SWITCH_ON),
        (S.FAULT_REACTION_ACTIVE, W.FAULT_RESET, S.FAULT_REACTION_ACTIVE),
        (S.FAULT, W.ENABLE_OPERATION, S.FAULT),
    ],
)
def test_transitions_are_those_of_the_standard(
    state: PowerState, word: int, after: PowerState
) -> None:
    assert after_controlword(state, word, 0) is after


def test_fault_reset_acts_on_the_rising_edge_only() -> None:
    assert after_controlword(S.FAULT, 0x0080, 0x0000) is S.SWITCH_ON_DISABLED
    assert after_controlword(S.FAULT, 0x0080, 0x0080) is S.FAULT


def units(
    unit: VelocityUnit = "increments_per_s",
    gear_ratio: float = 100.0,
    direction: Literal[1, -1] = 1,
) -> AxisUnits:
    motor = MotorRatings(increments=4096, torque_nm=2.0)
    return AxisUnits.of_motor(motor, ServoProfile(velocity_unit=unit), gear_ratio, direction, 1000)


def test_one_revolution_of_a_joint_is_converted_to_counts() -> None:
    assert units().position(1000 + 409_600) == pytest.approx(2 * math.pi, rel=1e-15)
    assert units(direction=-1).position(1000 + 409_600) == pytest.approx(-2 * math.pi)


def test_the_rated_torque_is_converted_to_the_joint_side() -> None:
    # 6077h counts 0.1 % of 6076h: 1000 is 2 N m at the motor, 200 N m with a gear of 100
    assert units().torque_nm(1000) == pytest.approx(200.0)
    assert units(direction=-1).torque_nm(1000) == pytest.approx(-200.0)


@pytest.mark.parametrize(
    ("unit", "value"),
    [("increments_per_s", 65190), ("rpm", 955), ("0.1rpm", 9549)],
)
def test_one_radian_per_second_is_converted_to_the_vendors_unit(
    unit: VelocityUnit, value: int
) -> None:
    assert round(units(unit).velocity_units_per_rad_s) == value
    assert round(units(unit, direction=-1).velocity_units_per_rad_s) == -value


def test_a_negative_gear_ratio_reverses_the_axis_once() -> None:
    assert units(gear_ratio=-100.0) == units()


@given(st.integers(-(2**31), 2**31 - 1), st.sampled_from([1, -1]), st.floats(0.5, 500.0))
def test_counts_are_converted_and_back_unchanged(
    counts: int, direction: Literal[1, -1], gear: float
) -> None:
    axis = units(direction=direction, gear_ratio=gear)
    assert axis.counts(axis.position(counts)) == counts


@given(st.integers(-(2**15), 2**15 - 1))
def test_torque_is_converted_and_back_unchanged(permille: int) -> None:
    assert round(units().torque_nm(permille) / units().nm_per_torque_unit) == permille


def test_invalid_factors_are_refused() -> None:
    with raises_code(ConfigError, "RID-SERVO-VALUE"):
        AxisUnits(0.0, 1.0, 1.0, 1.0)
