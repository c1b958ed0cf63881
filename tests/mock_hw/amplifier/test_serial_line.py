"""Times at which bytes arrive over the simulated serial line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mock_hw.amplifier.serial_line import SerialLine

BYTE_S = 10 / 115200


def test_a_byte_takes_ten_bits_and_waits_for_the_previous_one() -> None:
    line = SerialLine(115200, 0.0, 0)
    arrived = line.send([1.0, 1.0, 2.0], [24, 48, 24])
    np.testing.assert_allclose(arrived, [1 + 24 * BYTE_S, 1 + 72 * BYTE_S, 2 + 24 * BYTE_S])
    assert line.free_s == pytest.approx(2 + 24 * BYTE_S)
    (later,) = line.send([2.0], [1])
    assert later == pytest.approx(2 + 25 * BYTE_S)
    assert len(line.send([], [])) == 0


@given(st.lists(st.tuples(st.floats(0.0, 0.01), st.integers(1, 60)), min_size=1, max_size=40))
def test_many_bytes_at_once_equal_many_one_after_the_other(units: list[tuple[float, int]]) -> None:
    ready = np.cumsum([wait for wait, _ in units])
    sizes = [size for _, size in units]
    at_once = SerialLine(460800, 0.0, 0).send(ready, sizes)
    line = SerialLine(460800, 0.0, 0)
    singly = [line.send([time_s], [size])[0] for time_s, size in zip(ready, sizes, strict=True)]
    np.testing.assert_allclose(at_once, singly, atol=1e-12)
    free_s = 0.0
    for time_s, size, arrived_s in zip(ready, sizes, singly, strict=True):
        free_s = max(free_s, time_s) + size * 10 / 460800
        assert arrived_s == pytest.approx(free_s)


def test_a_polled_adapter_delivers_late_in_bunches_and_in_order() -> None:
    ready = np.arange(4000) * 0.001
    sent = SerialLine(460800, 0.0, 0).send(ready, np.full(4000, 28))
    arrived = SerialLine(460800, 0.005, 7).send(ready, np.full(4000, 28))
    late = arrived - sent
    assert (np.diff(arrived) >= 0.0).all()
    assert (late >= 0.0).all()
    assert late.min() < 1e-4
    assert 0.004 < late.max() <= 0.005
    assert len(np.unique(arrived)) < 2000
    again = SerialLine(460800, 0.005, 7).send(ready, np.full(4000, 28))
    assert (again == arrived).all()
    assert (SerialLine(460800, 0.005, 8).send(ready, np.full(4000, 28)) != arrived).any()


def test_nothing_arrives_during_a_stall() -> None:
    line = SerialLine(460800, 0.0, 0)
    line.stall(1.5)
    arrived = line.send([1.0, 1.2, 1.6], [28, 28, 28])
    np.testing.assert_allclose(arrived, [1.5, 1.5, 1.6 + 28 * 10 / 460800])
