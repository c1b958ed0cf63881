"""`warm_up_plot`: what friction takes in one period after the other, as motors warm up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.payload.warm_up import FEWEST_PERIODS, power_change_percent
from rid_daq.blocks.plot import Axis, Line, Panel, Plot


def warm_up_plot(
    joint_names: Sequence[str], power_w: Sequence[Sequence[float]], settled_percent: float
) -> Plot:
    """Return the plot of each joint's friction power, and of its change in a period.

    Args:
        joint_names: Base to flange.
        power_w: Mean mechanical power of each joint, one row a whole period [W], as `period_powers`
            returns it.
        settled_percent: The change of a period that counts as warm [%].
    """
    power = np.asarray(power_w, dtype=np.float64).reshape(-1, len(joint_names))
    ends = range(FEWEST_PERIODS, len(power) + 1)
    change = np.array([power_change_percent(power[:last]) for last in ends])
    change = change.reshape(-1, len(joint_names))
    periods = [float(number) for number in range(1, len(power) + 1)]
    widest = None if len(change) else 2.0 * settled_percent
    return Plot(
        name="warm_up",
        panels=(
            Panel(
                title="friction of each period",
                x=Axis(label="period", unit="1"),
                y=Axis(label="friction", unit="W"),
                lines=_lines(joint_names, periods, power),
                height_px=260,
            ),
            Panel(
                title=f"change of a period, settled at {settled_percent:g} %",
                x=Axis(label="period", unit="1"),
                y=Axis(
                    label="change",
                    unit="%",
                    least=None if widest is None else -widest,
                    most=widest,
                ),
                lines=_lines(joint_names, periods[FEWEST_PERIODS - 1 :], change),
                limits=(-settled_percent, settled_percent),
                height_px=200,
                zooms_with_previous=True,
            ),
        ),
    )


def _lines(
    joint_names: Sequence[str],
    x: Sequence[float],
    values: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> tuple[Line, ...]:
    return tuple(
        Line(label=joint, x=tuple(x), y=values[:, j].tolist(), stroke=j)
        for j, joint in enumerate(joint_names)
    )
