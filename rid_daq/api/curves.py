"""`curves_plot`: quantities over time or speed, one line for each joint."""

from __future__ import annotations

from typing import Final

from config.arrays import FloatArray
from rid_daq.blocks.plot import Axis, Line, Panel, Plot

_POINTS: Final = 2000


def curves_plot(
    names: tuple[str, ...],
    along: Axis,
    x: FloatArray,
    parts: tuple[tuple[Axis, FloatArray], ...],
) -> Plot:
    """Return a plot with a panel for each quantity and a line for each joint.

    Long curves are drawn with fewer points.
    """
    every = slice(None, None, max(1, len(x) // _POINTS))
    return Plot(
        name="curves",
        panels=tuple(
            Panel(
                x=along,
                y=axis,
                lines=tuple(
                    Line(name, tuple(x[every].tolist()), tuple(values[every, j].tolist()), j)
                    for j, name in enumerate(names)
                ),
                zooms_with_previous=number > 0,
            )
            for number, (axis, values) in enumerate(parts)
        ),
    )
