"""Curves of a report: torque over time, residuals over frequency, and traces of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rid_daq.blocks.block import AnyBlock, Heading, Text
from rid_daq.blocks.plot import Axis, Colour, Gapped, Line, Panel, Plot
from rid_daq.report.sections.curves import (
    CurvesSection,
    SpectrumCurves,
    TorqueCurve,
    TorqueCurves,
    Traces,
)

WIDE_PX: Final = 4.5
THIN_PX: Final = 1.2
RESIDUAL_REACH: Final = 1.2
"""Height of a residual panel relative to the largest residual that counts."""


def curves_blocks(section: CurvesSection) -> Iterator[AnyBlock]:
    """Yield measured and predicted torque, and the spectrum of the residual."""
    if section.torque is not None:
        yield Heading(text="Measured and predicted torque")
        yield Text(text=section.torque.sentence)
        yield torque_plot(section.torque)
    if section.spectrum is not None:
        yield Heading(text="Residual spectrum and noise floor")
        yield Text(text=section.spectrum.sentence)
        yield spectrum_plot(section.spectrum)


def torque_plot(curves: TorqueCurves) -> Plot:
    """Return measured and predicted torque over time, and the residual, for each axis.

    Args:
        curves: Curves of a validation, or of the mean period to which a model was fitted.
    """
    panels = [panel for axis in curves.axes for panel in _torque_panels(curves, axis)]
    return Plot(name="fit", panels=tuple(panels))


def _torque_panels(curves: TorqueCurves, axis: TorqueCurve) -> tuple[Panel, Panel]:
    residual = [one - other for one, other in zip(axis.measured, axis.predicted, strict=True)]
    counted = [abs(value) for value, counts in zip(residual, axis.counted, strict=True) if counts]
    reach = RESIDUAL_REACH * max(counted, default=0.0) or None
    time, is_first = Axis("time", "s"), axis is curves.axes[0]

    def line(label: str, values: Gapped, stroke: Colour, width: float) -> Line:
        named = label not in ("residual", "residual, not counted")
        return Line(label, curves.time_s, values, stroke, width=width, is_named=named)

    def mask(values: Sequence[float], counts: int) -> Gapped:
        return tuple(
            value if each == counts else None
            for value, each in zip(values, axis.counted, strict=True)
        )

    pale = [] if all(axis.counted) else [0]
    return (
        Panel(
            title=f"{axis.joint}: {axis.caption}",
            x=time,
            y=Axis("torque", axis.unit),
            lines=(
                *(line("not counted", mask(axis.predicted, 0), "faint", WIDE_PX) for _ in pale),
                line("predicted", mask(axis.predicted, 1), "orange", WIDE_PX),
                line("measured", axis.measured, "ink", THIN_PX),
            ),
            height_px=230,
            zooms_with_previous=not is_first,
        ),
        Panel(
            x=time,
            y=Axis("residual", axis.unit, least=None if reach is None else -reach, most=reach),
            lines=(
                *(line("residual, not counted", mask(residual, 0), "faint", THIN_PX) for _ in pale),
                line("residual", mask(residual, 1), "red", THIN_PX),
            ),
            height_px=150,
            zooms_with_previous=True,
        ),
    )


def spectrum_plot(spectrum: SpectrumCurves) -> Plot:
    """Return torque, residual and noise over frequency, one panel per axis."""
    panels = [
        Panel(
            title=axis.joint,
            x=Axis("frequency", "Hz"),
            y=Axis("RMS torque", axis.unit or "N m", log=True),
            lines=(
                Line(
                    "torque",
                    spectrum.frequency_hz,
                    _positive(axis.measured_nm),
                    "faint",
                    points=True,
                    marker="square",
                ),
                Line(
                    "residual",
                    spectrum.frequency_hz,
                    _positive(axis.residual_nm),
                    "red",
                    points=True,
                ),
                Line("noise", spectrum.frequency_hz, _positive(axis.noise_nm), "blue"),
            ),
            zooms_with_previous=axis is not spectrum.axes[0],
        )
        for axis in spectrum.axes
    ]
    return Plot(name="residual_spectrum", panels=tuple(panels), columns=3)


def traces_plot(traces: Traces) -> Plot:
    """Return position, speed, torque and following error over time, one line per joint.

    Set-points are dotted. Joints with different units have separate panels.
    """
    panels: list[Panel] = []
    for unit, torque_unit in dict.fromkeys((axis.unit, axis.torque_unit) for axis in traces.axes):
        quantities = (
            ("position", unit, ("position", "set_point")),
            ("speed", f"{unit}/s", ("speed",)),
            ("torque" if unit == "rad" else "force", torque_unit, ("torque",)),
            ("following error", unit, ("following_error",)),
        )
        for label, in_unit, names in quantities:
            lines = tuple(
                Line(
                    axis.joint if name != "set_point" else f"{axis.joint}, set-point",
                    traces.time_s,
                    getattr(axis, name),
                    j,
                    dash="dotted" if name == "set_point" else None,
                    width=THIN_PX,
                    is_named=label == "position",
                )
                for name in names
                for j, axis in enumerate(traces.axes)
                if axis.unit == unit and getattr(axis, name) is not None
            )
            if lines:
                panels.append(
                    Panel(
                        x=Axis("time", "s"),
                        y=Axis(label, in_unit),
                        lines=lines,
                        height_px=260 if not panels else 190,
                        zooms_with_previous=bool(panels),
                    )
                )
    caption = "Rows without a valid answer are left out."
    if traces.rows_per_step > 1:
        caption += (
            f" Each step of {traces.rows_per_step} rows is drawn by its lowest and highest value."
        )
    return Plot(name="traces", panels=tuple(panels), caption=caption)


def _positive(values: tuple[float, ...]) -> Gapped:
    """Return values for a logarithmic axis, with gaps instead of values that are not positive."""
    return tuple(value if value > 0.0 else None for value in values)
