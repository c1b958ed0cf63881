"""`plot`: figures of recordings, models, validations, motions and payloads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure

from config.arrays import FloatArray
from config.errors import ConfigError
from rid_daq.api.model import Model
from rid_daq.api.motion import Motion
from rid_daq.api.recording import Recording
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.report_page.drawings.plot import matplotlib_figure

POINTS = 2000
SPEEDS = 201


class Shown(Protocol):
    """A result of the API, which has blocks."""

    def blocks(self) -> Iterable[AnyBlock]:
        """Return what people see of it."""
        ...


def plot(result: Recording | Shown) -> Figure:
    """Return a figure of a result, drawn by matplotlib.

    A recording or motion over time, the friction of a model over speed, the torques of a
    validation, the centre of gravity of a payload, the torques of a retimed path.

    Args:
        result: What is drawn.

    Returns:
        A figure: a notebook shows it, and its `savefig` writes it.

    Raises:
        ConfigError: There is nothing to draw (RID-API-ARGUMENT).
    """
    found = next(_plots(result), None)
    if found is None:
        raise ConfigError(
            f"{type(result).__name__}: there is nothing to draw of it", code="RID-API-ARGUMENT"
        )
    return matplotlib_figure(found)


def _plots(result: Recording | Shown) -> Iterator[Plot]:
    if isinstance(result, Recording):
        names, time_s = result.joint_names, result.time_s - result.time_s[0]
        position, torque = Axis("position", "rad or m"), Axis("torque", "N m or N")
        parts = ((position, result.position), (torque, result.torque_nm))
        yield _curves(names, Axis("time", "s"), time_s, parts)
        return
    yield from (each for each in result.blocks() if isinstance(each, Plot))
    if isinstance(result, Motion):
        names = result.samples.joint_names
        position, velocity = Axis("position", "rad or m"), Axis("velocity", "rad/s or m/s")
        parts = ((position, result.position), (velocity, result.velocity))
        yield _curves(names, Axis("time", "s"), result.time_s, parts)
    if isinstance(result, Model):
        limits = [joint.limits.velocity for joint in result.robot.description.joints]
        share = np.linspace(-1.0, 1.0, SPEEDS)
        torques = result.friction(np.outer(share, limits))
        axis = Axis("friction", "N m or N")
        names = result.robot.joint_names
        yield _curves(names, Axis("speed / limit", "1"), share, ((axis, torques),))


def _curves(
    names: tuple[str, ...],
    along: Axis,
    x: FloatArray,
    parts: tuple[tuple[Axis, FloatArray], ...],
) -> Plot:
    """Return a panel for each quantity with a line for each joint."""
    every = slice(None, None, max(1, len(x) // POINTS))
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
