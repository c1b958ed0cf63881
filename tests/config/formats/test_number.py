"""Numbers are plain decimal digits; other notations of Python's `float` are refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ConfigError
from config.formats.number import NUMBER_CODE, number_hint, parse_number, parse_numbers


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("-1.5", -1.5), (".5", 0.5), ("3.", 3.0), (" +2e-3 ", 0.002), ("1E5", 1e5)],
)
def test_plain_numbers_are_read(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "1_5", "-1_5", "6,0", "1.234,5", "1,234.5", "1 000", "1'000", "nan", "-inf"),
        *("infinity", "1e999", "0x10", "2.0 rad/s", "300Nm", "-86°", "${pi/2}", "$(arg x)", "pi"),
        *("2*2.9", "1.5.2", "--1", "1e", "٣", "1\x00", "½"),
    ],
)
def test_other_notations_are_refused_with_a_code(text: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse_number(text)
    assert refused.value.refusal == NUMBER_CODE


@given(st.text(max_size=8))
def test_the_value_is_that_of_the_digits(text: str) -> None:
    try:
        value = parse_number(text)
    except ConfigError:
        return
    assert value == float(text)
    assert set(text.strip()) <= set("0123456789+-.eE")


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("6,0", "decimal comma"),
        ("0 1,57 0", "decimal comma"),
        ("${-pi/6}", "xacro"),
        ("2.0 rad/s", "unit"),
        ("1_5", "digits"),
        ("nan", "finite"),
        ("165205", "quotes"),
        ("1e999", "too large"),
    ],
)
def test_a_hint_names_the_likely_cause(text: str, hint: str) -> None:
    assert hint in number_hint(text)


def test_a_list_is_refused_if_one_number_is_invalid() -> None:
    assert parse_numbers("1, 2.5") == (1.0, 2.5)
    with pytest.raises(ConfigError):
        parse_numbers("1,,2")
