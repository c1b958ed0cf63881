from __future__ import annotations

import struct
import subprocess
import sys
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.journal.cycle_row import FIELDS, joints_of_row, row_dtype, row_struct
from acquisition.journal.row_layout import message_text
from acquisition.task.ring import Ring
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code


def a_row(joints: int, cycle: int) -> tuple[float, ...]:
    return (
        *(cycle * 0.008, 0.0, 0.001),
        *(cycle + 0.1 * i for i in range(5 * joints)),
        *(range(joints)),
        *(cycle, cycle - 1),
        *(range(3 * joints)),
        3,
    )


@pytest.mark.parametrize("joints", [1, 3, 6, 7, 16])
def test_a_row_has_the_same_layout_in_struct_numpy_and_the_ros_message(joints: int) -> None:
    dtype = row_dtype(joints)
    assert row_struct(joints).size == dtype.itemsize
    row = np.frombuffer(row_struct(joints).pack(*a_row(joints, 7)), dtype=dtype)[0]
    assert row["cycle"] == 7
    assert row["phase"] == 3
    # CDR: every primitive aligned to its size, fixed arrays without a length
    sizes = {"float64": 8, "int32": 4, "uint32": 4, "int16": 2, "uint16": 2, "uint8": 1}
    assert dtype.fields is not None
    offsets: dict[str, int] = {key: field[1] for key, field in dtype.fields.items()}
    offset = 0
    for line in message_text(FIELDS, joints).splitlines():
        kind, name = line.split("#")[0].split()
        size = sizes[kind.split("[")[0]]
        offset += -offset % size
        assert offsets[name] == offset, name
        offset += size * (joints if "[" in kind else 1)
    assert offset == dtype.itemsize


def test_the_number_of_joints_is_derived_from_the_row_size() -> None:
    assert [joints_of_row(row_struct(n).size) for n in range(1, 17)] == list(range(1, 17))
    assert joints_of_row(100) is None


@settings(max_examples=50)
@given(
    st.integers(1, 9),
    st.lists(st.one_of(st.just("write"), st.integers(1, 12)), max_size=60),
)
def test_rows_are_read_unchanged_and_none_is_overwritten(
    capacity: int, steps: list[str | int]
) -> None:
    ring, model, cycle = Ring.create(2, capacity), deque[int](), 0
    for step in steps:
        if step == "write":
            accepted = ring.write(a_row(2, cycle))
            assert accepted == (len(model) < capacity)
            if accepted:
                model.append(cycle)
            cycle += 1
        else:
            rows = np.frombuffer(ring.read(int(step)), dtype=row_dtype(2))
            assert len(rows) <= int(step)
            assert len(rows) > 0 or not model
            assert rows["cycle"].tolist() == [model.popleft() for _ in range(len(rows))]
        assert ring.waiting == len(model)
        assert ring.fill == len(model) / capacity


def test_a_row_that_does_not_fit_its_fields_is_refused() -> None:
    with pytest.raises(struct.error):
        Ring.create(2, 4).write(a_row(2, -1))


def test_a_ring_without_room_for_a_row_is_refused() -> None:
    with raises_code(RecordingError, "RID-INTERNAL-ERROR", "capacity"):
        Ring.create(3, 0)


CHILD = """
import sys
from acquisition.task.ring import Ring
from tests.acquisition.task.test_ring import a_row
before, ring = Ring.create(3, 8), Ring.create(2, 4)
assert before.write(a_row(3, 9))
assert all(ring.write(a_row(2, cycle)) for cycle in range(4))
ring.read(1)
assert ring.write(a_row(2, 4))
print("ready", flush=True)
sys.stdin.readline()
print(ring.waiting, ring.written)
"""


def test_another_program_reads_the_newest_rows_and_cannot_change_them() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[3],
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        ring = Ring.of_process(program.pid)
        assert ring is not None
        assert (ring.joints, ring.capacity, ring.written, ring.waiting) == (2, 4, 5, 4)
        with pytest.raises(TypeError, match="read-only"):
            ring.read()
        with pytest.raises((TypeError, struct.error, BufferError)):
            ring._pack_into(ring._rows, 0, *a_row(2, 7))
        output, _ = program.communicate("\n", timeout=120.0)
    assert output == "4 5\n"
    rows = np.frombuffer(ring.latest(2), dtype=row_dtype(2))
    assert rows["cycle"].tolist() == [3, 4], (
        "the last rows stay readable after their writer has ended"
    )
    assert Ring.of_process(program.pid) is None
