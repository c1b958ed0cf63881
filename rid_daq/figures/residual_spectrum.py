"""`residual_spectrum`: what a model leaves at each harmonic, against the noise floor."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import GridPlot
from bokeh.plotting import figure

from rid_daq.figures.palette import BLUE, FAINT, RED
from rid_daq.figures.panel import add_hover, add_legend, beside, layout, panel, source
from rid_daq.report.sections.curves import SpectrumCurves

FREQUENCY: Final = "frequency [Hz]"


def residual_spectrum(spectrum: SpectrumCurves, units: tuple[str, ...]) -> GridPlot:
    """Return a figure of torque, residual and noise by frequency, one panel a joint.

    Parameters
    ----------
    spectrum : SpectrumCurves
        Of a mean period.
    units : tuple of str
        The unit of each axis' torque.
    """
    panels: list[figure] = []
    for axis, unit in zip(spectrum.axes, units, strict=True):
        names = [f"{axis.joint} {word} [{unit}]" for word in ("torque", "residual", "noise")]
        curves = [
            _positive(values) for values in (axis.measured_nm, axis.residual_nm, axis.noise_nm)
        ]
        rows = source(
            axis.joint,
            {FREQUENCY: spectrum.frequency_hz, **dict(zip(names, curves, strict=True))},
        )
        plot = panel(
            axis.joint,
            FREQUENCY,
            f"rms torque [{unit}]",
            y_scale="log",
            x_range=panels[0].x_range if panels else None,
        )
        torque = plot.scatter(
            FREQUENCY, names[0], source=rows, marker="square", size=5, color=FAINT
        )
        noise = plot.line(FREQUENCY, names[2], source=rows, line_color=BLUE, line_width=2.0)
        left = plot.scatter(FREQUENCY, names[1], source=rows, marker="circle", size=5, color=RED)
        shown = {"frequency": FREQUENCY, "torque": names[0], "residual": names[1]}
        add_hover(plot, left, {**shown, "noise": names[2]}, along_x=True, digits=4)
        add_legend(plot, {"torque": [torque], "residual": [left], "noise": [noise]})
        panels.append(plot)
    return layout("residual_spectrum", [beside(panels)], panels)


def _positive(values: tuple[float, ...]) -> np.ndarray:
    """Return values for a logarithmic axis, none where there is nothing."""
    array = np.asarray(values, dtype=np.float64)
    return np.where(array > 0.0, array, np.nan)
