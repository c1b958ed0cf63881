"""`friction_figure`: a joint's measured friction over its speed, with the models through it."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import GridPlot
from bokeh.plotting import figure

from rid_daq.figures.palette import BLUE, INK, ORANGE, PURPLE, SOFT, Stroke
from rid_daq.figures.panel import Drawn, add_hover, add_legend, beside, layout, panel, source
from rid_daq.report.sections.friction import FrictionSection, JointFriction

_LINES: Final = (Stroke(ORANGE, "solid"), Stroke(BLUE, "dashed"), Stroke(PURPLE, "dotdash"))


def friction_figure(section: FrictionSection) -> GridPlot:
    """Return a figure of measured friction ± 2σ over speed and of the models, joint by joint.

    Parameters
    ----------
    section : FrictionSection
        As measured by `rid-daq friction`.
    """
    panels = [_panel(joint) for joint in section.joints]
    return layout("friction", [beside(panels)], panels)


def _panel(joint: JointFriction) -> figure:
    curve, lines = joint.curve, joint.lines
    speed, torque = f"speed [{joint.unit}/s]", f"friction [{joint.torque_unit}]"
    odd, reach = np.asarray(curve.odd), 2.0 * np.asarray(curve.odd_std)
    columns = {
        speed: np.asarray(curve.speed),
        torque: odd,
        f"friction - 2σ [{joint.torque_unit}]": odd - reach,
        f"friction + 2σ [{joint.torque_unit}]": odd + reach,
    }
    forward, backward = (
        f"friction {way} [{joint.torque_unit}]" for way in ("forwards", "backwards")
    )
    if curve.forward is not None and curve.backward is not None:
        columns[forward] = np.asarray(curve.forward)
        columns[backward] = -np.asarray(curve.backward)
    measured = source(f"{joint.joint} measured", columns)
    models = source(
        f"{joint.joint} models",
        {
            speed: lines.speed,
            **{f"{name} [{joint.torque_unit}]": line for name, line in lines.torque.items()},
        },
    )
    plot = panel(joint.joint, speed, torque, height=280)
    entries: dict[str, list[Drawn]] = {}
    for name, (color, dash) in zip(lines.torque, _LINES, strict=False):
        entries[name] = [
            plot.line(
                speed,
                f"{name} [{joint.torque_unit}]",
                source=models,
                line_color=color,
                line_dash=dash,
                line_width=3.0,
            )
        ]
    low, high = list(columns)[2:4]
    bars = plot.segment(speed, low, speed, high, source=measured, line_color=SOFT, line_width=2.0)
    dots = plot.scatter(speed, torque, source=measured, size=6, color=INK)
    entries = {"measured ± 2σ": [dots, bars], **entries}
    if forward in columns:
        ways = (("forwards", forward, "triangle"), ("backwards", backward, "inverted_triangle"))
        for word, column, marker in ways:
            entries[word] = [
                plot.scatter(
                    speed,
                    column,
                    source=measured,
                    marker=marker,
                    size=7,
                    line_color=SOFT,
                    fill_alpha=0.0,
                )
            ]
    add_hover(plot, dots, {"speed": speed, "friction": torque, "- 2σ": low, "+ 2σ": high}, digits=4)
    add_legend(plot, entries)
    return plot
