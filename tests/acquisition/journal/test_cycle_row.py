"""Journal row: its values are written by field name, in the same layout as the file."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquisition.journal.cycle_row import CycleRow, row_dtype, row_struct


def test_a_row_has_the_fields_of_the_file_in_their_order() -> None:
    assert CycleRow._fields == row_dtype(3).names


@pytest.mark.parametrize("joints", [1, 3, 16])
def test_values_written_by_name_are_read_by_name(joints: int) -> None:
    dtype = row_dtype(joints)
    fields: dict[str, Any] = {}  # name of a field: a list or a number, as its dtype requires
    for number, name in enumerate(CycleRow._fields):
        shape = dtype[name].shape
        fields[name] = [number + 1] * shape[0] if shape else number + 1
    packed = row_struct(joints).pack(*CycleRow(**fields).values())
    (row,) = np.frombuffer(packed, dtype)
    assert {name: row[name].tolist() for name in CycleRow._fields} == fields
