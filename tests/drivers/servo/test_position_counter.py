"""Positions that wrap, at 32 bits or earlier (607Bh), are not jumps of the joint."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.cell.cell import CellConfig
from config.errors import PreflightError
from drivers.servo.position_counter import BITS_32, PositionCounter

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

COUNTS_PER_RAD = 100 * 4096 / (2.0 * math.pi)


@st.composite
def counters(draw: st.DrawFn) -> PositionCounter:
    lowest = draw(st.integers(-(2**31), 2**31 - 2))
    return PositionCounter(lowest, draw(st.integers(lowest + 1, 2**31 - 1)))


@given(counters(), st.integers(-(2**40), 2**40), st.data())
def test_a_count_within_half_a_turn_of_a_known_one_is_unwrapped(
    counter: PositionCounter, known: int, data: st.DataObject
) -> None:
    half = counter.size // 2
    true = known + data.draw(st.integers(-half, counter.size - half - 1))
    shown = counter.to_range(true)
    assert counter.lowest <= shown <= counter.highest
    assert counter.nearest(shown, known) == true


def test_equal_limits_mean_no_limit() -> None:
    assert PositionCounter.of_limits(0, 0) == BITS_32
    assert PositionCounter.of_limits(0, 99).size == 100
    assert not BITS_32.is_smaller_than_32_bits


@pytest.mark.parametrize(
    ("start", "limits"),
    [
        (2**31 - 1500, None),  # counts to the end of 32 bits
        (-(2**31) + 900, None),
        (499_000, (0, 499_999)),  # a drive that wraps earlier
        (0, (0, 499_999)),
    ],
)
@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_a_joint_moves_over_the_wrap_without_a_jump(
    make_bench: Callable[[CellConfig], Bench],
    cell: CellConfig,
    start: int,
    limits: tuple[int, int] | None,
    speed: float,
) -> None:
    axes = [
        each.model_copy(update={"position_zero_counts": start}) if each.joint == "base" else each
        for each in cell.axes
    ]
    bench = make_bench(cell.model_copy(update={"axes": tuple(axes)}))
    drive = bench.drives[0]
    if limits is not None:
        for sub, value in enumerate(limits, 1):
            drive.objects[0x607B, sub] = value.to_bytes(4, "little", signed=True)
    drive.objects[0x6064, 0] = start.to_bytes(4, "little", signed=True)
    bench.enabled()
    positions = []
    for _ in range(40):
        bench.cycle((speed, 0.0, 0.0))
        positions.append(float(bench.axes.answers.position[0]))
    steps = [after - before for before, after in itertools.pairwise(positions[2:])]
    assert positions[0] == pytest.approx(0.0, abs=0.01)
    assert steps == pytest.approx([speed * 0.008] * len(steps), abs=2.0 / COUNTS_PER_RAD)
    assert [s.verdict for s in bench.axes.settings() if s.object_name == "607Bh:00"] == (
        [] if limits is None else ["ok"]
    )


def test_a_counter_shorter_than_the_joints_range_is_refused(bench: Bench) -> None:
    for sub, value in enumerate((0, 300_000), 1):  # 4.6 rad; the joint has 6 rad
        bench.drives[1].objects[0x607B, sub] = value.to_bytes(4, "little")
    with pytest.raises(PreflightError):
        bench.axes.bring_up()
    assert bench.found("607Bh:00", node_id=2).verdict == "red"


@pytest.mark.parametrize(("rated_mnm", "verdict"), [(2000, "ok"), (2_000_000, "red"), (3, "red")])
def test_an_implausible_rated_torque_is_refused(bench: Bench, rated_mnm: int, verdict: str) -> None:
    bench.drives[0].objects[0x6076, 0] = rated_mnm.to_bytes(4, "little")
    if verdict == "red":
        with pytest.raises(PreflightError):
            bench.axes.bring_up()
    else:
        bench.axes.bring_up()
    (found,) = (
        each
        for each in bench.axes.settings()
        if each.node_id == 1 and each.name == "rated torque at the joint"
    )
    assert found.verdict == verdict
    assert found.found == f"{rated_mnm / 10:.4g} N m"  # gear 100
