"""Two answers with one identifier in a cycle: counted, and ignored if they differ."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from drivers.canopen.frames import Frame

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

STILL = (0.0, 0.0, 0.0)


def test_two_answers_that_differ_are_both_ignored(bench: Bench) -> None:
    axes = bench.enabled()
    bench.arrives(Frame(0x181, struct.pack("<Hih", 0x1027, 77, 0)), 200e-6)
    bench.cycle(STILL)
    assert axes.cyclic.duplicate_frames == 1
    assert axes.answers.received.tolist() == [False, True, True]
    assert axes.answers.position_counts[0] == 1000
    assert axes.cyclic.contradictions.tolist() == [1, 0, 0]
    bench.cycle(STILL)
    assert axes.answers.received.all()


def test_a_copy_of_an_answer_is_counted_and_otherwise_ignored(bench: Bench) -> None:
    axes = bench.enabled()
    bench.cycle(STILL)
    same = struct.pack("<Hih", axes.answers.statusword[0], 1000, axes.answers.torque_raw[0])
    bench.arrives(Frame(0x181, same), 200e-6)
    bench.cycle(STILL)
    assert axes.answers.received.all()
    assert axes.answers.second_answers.tolist() == [1, 0, 0]
    assert axes.cyclic.contradictions.tolist() == [0, 0, 0]


def test_answers_after_the_last_expected_one_belong_to_the_same_cycle(bench: Bench) -> None:
    axes = bench.enabled()
    for cycle in range(1, 4):
        bench.arrives(Frame(0x182, struct.pack("<Hih", 0x1027, 77, 0)), 0.004)
        bench.cycle(STILL)
        assert axes.answers.received.tolist() == [True, cycle == 1, True], (
            "from cycle 2 on, the exchange waits for both answers"
        )
    bench.cycle(STILL)
    assert axes.answers.second_answers.tolist() == [0, 3, 0]
    assert axes.cyclic.contradictions.tolist() == [0, 3, 0]
    assert (axes.cyclic.duplicate_frames, axes.answers.late_frames) == (3, 0)


def test_a_second_answer_without_power_ends_the_motion(bench: Bench) -> None:
    axes = bench.enabled()
    bench.cycle(STILL)
    bench.arrives(Frame(0x181, struct.pack("<Hih", 0x0250, 1000, 0)), 200e-6)
    assert not bench.cycle(STILL), "no further velocity is sent"
    assert axes.cyclic.contradictions.tolist() == [1, 0, 0]
