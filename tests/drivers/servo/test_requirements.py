from __future__ import annotations

import pytest

from config.errors import ConfigError
from drivers.servo.requirements import Requirement


def test_what_does_not_fit_into_the_object_is_the_cell_files_fault() -> None:
    window = Requirement(0x6065, 0, 4, "following-error window", 2**40)
    with pytest.raises(ConfigError, match=r"window: .* does not fit the 32 bits of 6065h"):
        window.encoded(2**40)
