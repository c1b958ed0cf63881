from __future__ import annotations

from config.errors import ConfigError
from drivers.servo.requirements import Requirement
from tests.builders.raised_codes import raises_code


def test_a_value_too_large_for_its_object_is_an_error_of_the_cell_file() -> None:
    window = Requirement(0x6065, 0, 4, "following-error window", 2**40)
    with raises_code(ConfigError, "RID-SERVO-VALUE", "window:", "32", "6065h"):
        window.encode(2**40)
