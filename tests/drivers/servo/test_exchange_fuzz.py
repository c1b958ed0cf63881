"""Random frames during the cyclic exchange: typed errors, or counted and ignored."""

from __future__ import annotations

import contextlib
import gc
import random
import tracemalloc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from config.cell.cell import CellConfig
from config.errors import RidDaqError
from drivers.canopen.frames import Frame, rpdo_cob_id, tpdo_cob_id

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

NODES = (1, 2, 3)
CYCLE_S = 0.008
STILL = (0.0, 0.0, 0.0)
MOST_EVENTS = 64

own_identifiers = st.sampled_from(
    [*map(tpdo_cob_id, NODES), *map(rpdo_cob_id, NODES)]
    + [base + node for base in (0x080, 0x280, 0x580, 0x600, 0x700) for node in (*NODES, 127)]
    + [0x000, 0x080, 0x100]
)
frames = st.builds(Frame, st.one_of(own_identifiers, st.integers(0, 0x7FF)), st.binary(max_size=8))
answers = st.builds(Frame, st.sampled_from([*map(tpdo_cob_id, NODES)]), st.binary(max_size=8))
cycles = st.lists(
    st.lists(st.tuples(st.one_of(answers, frames), st.floats(0.0, CYCLE_S)), max_size=8),
    min_size=1,
    max_size=5,
)


@settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(strange=cycles, silent=st.sets(st.integers(0, 2)))
def test_any_frames_in_motion_are_typed_errors_or_events_without_delay(
    make_bench: Callable[[CellConfig], Any],
    cell: CellConfig,
    strange: list[list[tuple[Frame, float]]],
    silent: set[int],
) -> None:
    bench = make_bench(cell)
    axes = bench.enabled()
    for drive in silent:
        bench.drives[drive].answers_sync = False  # the random frames may be the only answers
    for arriving in strange:
        for frame, after_s in arriving:
            bench.arrives(frame, after_s)
        began_s = bench.bus.now_s
        with contextlib.suppress(RidDaqError):
            bench.cycle(STILL)
        assert bench.bus.now_s - began_s <= 1.6 * CYCLE_S + 1e-9
        events = axes.take_events()
        assert len(events) <= MOST_EVENTS
        assert all(event.text.isprintable() for event in events)
        assert np.isfinite(axes.answers.position).all()
        assert np.isfinite(axes.answers.torque_nm).all()
        assert axes.answers.received.shape == (3,)
    axes.quick_stop()


@pytest.mark.parametrize("length", range(8))
def test_an_answer_of_any_other_length_is_never_used(bench: Bench, length: int) -> None:
    axes = bench.enabled()
    bench.cycle(STILL)
    before = axes.answers.position.tolist()
    bench.drives[0].answers_sync = False
    bench.arrives(Frame(tpdo_cob_id(1), b"\xff" * length), 0.001)
    bench.cycle(STILL)
    assert not axes.answers.received[0]
    assert axes.answers.position[0] == before[0]
    assert [event.kind.name for event in axes.take_events()] == ["WRONG_LENGTH"]


def test_a_flood_of_frames_needs_bounded_memory(bench: Bench) -> None:
    axes, chance = bench.enabled(), random.Random(3)
    identifiers = [*map(tpdo_cob_id, NODES), 0x081, 0x181, 0x3AA, 0x582, 0x701, 0x7FF]

    def flooded(count: int) -> None:
        for number in range(count):
            data = chance.randbytes(chance.randrange(9))
            bench.arrives(Frame(chance.choice(identifiers), data), CYCLE_S * number / count)
        bench.cycle(STILL)

    def memory_b() -> int:
        gc.collect()  # without objects that wait for the garbage collector
        ours = [tracemalloc.Filter(False, "*/tests/*"), tracemalloc.Filter(True, "*/drivers/*")]
        return sum(t.size for t in tracemalloc.take_snapshot().filter_traces(ours).traces)

    tracemalloc.start()
    try:
        for _ in range(3):
            flooded(500)
        before = memory_b()
        for _ in range(12):
            flooded(500)
        # The data of the last emergencies is kept; 60 bytes per frame would be 360,000.
        assert memory_b() - before < 20_000
        assert before < 100_000
    finally:
        tracemalloc.stop()
    assert 0 < len(axes.take_events()) <= MOST_EVENTS
