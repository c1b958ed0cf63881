"""Load of a CAN bus that follows from the typical length of its frames."""

from __future__ import annotations

import pytest

from drivers.canopen.bus_load import cyclic_load, typical_bits


def test_a_typical_frame_lies_between_the_shortest_and_the_longest() -> None:
    assert typical_bits(8) == 119  # 111 bits without stuff bits, at most 135


@pytest.mark.parametrize(
    ("axes", "cycle_s", "percent"),
    [(3, 0.001, 77), (4, 0.001, 101), (6, 0.002, 75), (3, 0.008, 10)],
)
def test_the_load_of_a_cycle(axes: int, cycle_s: float, percent: int) -> None:
    load = cyclic_load(axes, cycle_s, 10**6, heartbeats_s=(0.025, 0.05))
    assert round(100 * load) == percent
