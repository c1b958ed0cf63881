"""`truth_blocks`: estimates of simulated robots compared with their true parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rid_daq.blocks.block import AnyBlock, Heading, Text
from rid_daq.blocks.plot import Axis, Colour, Line, Marker, Panel, Plot
from rid_daq.report.sections.validation import TruthCase

INSIDE: Final = 2.0
LEAST_REACH: Final = 4.0


def truth_blocks(cases: Sequence[TruthCase]) -> Iterator[AnyBlock]:
    """Yield the number of parameters inside their intervals, and the deviation of each.

    Args:
        cases: One entry per simulated robot.
    """
    yield Heading(text="Estimated and true parameters", level=3)
    for case in cases:
        yield Text(text=case.sentence)
    yield truth_plot(cases)


def truth_plot(cases: Sequence[TruthCase]) -> Plot:
    """Return the deviations in standard deviations, one panel per simulated robot.

    Args:
        cases: One entry per simulated robot.
    """
    panels = tuple(_panel(case) for case in cases)
    return Plot(name="truth", panels=panels, columns=max(2, len(panels)))


def _panel(case: TruthCase) -> Panel:
    numbered = list(enumerate(map(float, case.deviation_sigmas), start=1))
    reach = max([LEAST_REACH, *(1.2 * abs(value) for _, value in numbered)])
    kinds: tuple[tuple[str, bool, Colour, Marker], ...] = (
        ("inside 2σ", True, "blue", "circle"),
        ("outside", False, "red", "diamond"),
    )
    lines = []
    for label, is_inside, colour, marker in kinds:
        own = [(i, value) for i, value in numbered if (abs(value) <= INSIDE) is is_inside]
        if own:
            lines.append(
                Line(
                    label,
                    tuple(float(i) for i, _ in own),
                    tuple(value for _, value in own),
                    colour,
                    points=True,
                    marker=marker,
                )
            )
    return Panel(
        title=case.title,
        x=Axis("parameter number", "1"),
        y=Axis("(estimate - truth) / σ", "1", least=-reach, most=reach),
        lines=tuple(lines),
        limits=(-INSIDE, INSIDE),
    )
