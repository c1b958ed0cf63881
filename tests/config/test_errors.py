from __future__ import annotations

from config.errors import DriverError, with_notes


def test_the_notes_of_an_error_are_part_of_its_text() -> None:
    error = DriverError("axis3 is silent")
    assert str(error) == "axis3 is silent"
    error.add_note("power is not confirmed off")
    error.add_note("the bus is not closed")
    assert str(error) == "axis3 is silent; power is not confirmed off; the bus is not closed"


def test_the_notes_of_any_exception_are_returned() -> None:
    error = KeyboardInterrupt()
    assert with_notes("interrupted", error) == "interrupted"
    error.add_note("power is not confirmed off")
    assert with_notes("interrupted", error) == "interrupted; power is not confirmed off"
