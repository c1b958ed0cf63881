from __future__ import annotations

from config.errors import ConfigError
from drivers.servo.requirements import Requirement
from tests.builders.raised_codes import raises_code


def test_what_does_not_fit_into_the_object_is_the_cell_files_fault() -> None:
    window = Requirement(0x6065, 0, 4, "following-error window", 2**40)
    with raises_code(ConfigError, "RID-SERVO-VALUE", "window:", "32", "6065h"):
        window.encoded(2**40)
