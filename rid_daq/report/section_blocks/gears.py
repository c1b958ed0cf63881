"""`gear_blocks`: stiffness and damping of the gears as a table, robot file keys, and plots."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Interval, Text, table
from rid_daq.blocks.formats import number
from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.report.sections.gears import AxisGear, GearsSection

NOT_SHOWN = "not shown"


def gear_blocks(section: GearsSection) -> Iterator[AnyBlock]:
    """Yield the gears, the reasons for missing values, the keys, and the responses."""
    yield Heading(text="Stiffness of the gears")
    yield Text(
        text=f"Spring and damper between motor and link, from the signals of the"
        f" {section.instruments}."
        " Encoders at the motors do not measure the deflection of these springs."
    )
    yield table(
        section.axes,
        Cells("joint", lambda axis: axis.joint),
        Cells("stiffness ± 2σ", lambda axis: _interval(axis.stiffness, axis.stiffness_std)),
        Cells("unit", lambda axis: axis.unit),
        Cells("damping ± 2σ", lambda axis: _interval(axis.damping, axis.damping_std)),
        Cells("unit", lambda axis: axis.damping_unit),
        Cells("motor inertia", lambda axis: axis.motor_inertia or NOT_SHOWN, "kg m² or kg"),
        Cells(
            "largest deflection",
            lambda axis: NOT_SHOWN if axis.bend is None else 1e3 * axis.bend,
            "mrad or mm",
            3,
        ),
        Cells("torque not explained", lambda axis: axis.residual_percent, "%", 2),
    )
    if section.tool_residual_m is not None:
        yield Text(
            text="Distance of the tracker's points from the fitted path:"
            f" {number(1e3 * section.tool_residual_m, 2)} mm RMS, without its constant part."
        )
    for axis in section.axes:
        if axis.reason is not None:
            yield Text(text=f"{axis.joint}: the data do not show the stiffness: {axis.reason}.")
    for joint, keys in section.keys.items():
        words = ", ".join(f"{name}: {value:g}" for name, value in keys.items())
        yield Text(text=f"Keys of joint {joint} in the robot file: {words}")
    yield gears_plot(section)


def gears_plot(section: GearsSection) -> Plot:
    """Return torque over motor velocity, measured and predicted, one panel per joint."""
    return Plot(
        name="gears",
        panels=tuple(_panel(axis) for axis in section.axes),
        caption="Magnitude of torque over motor velocity at the lines of the multisine, without the"
        " part that friction explains, over all realisations. A maximum is the resonance of the"
        " link with a locked motor; the minimum above it is the resonance of motor and link against"
        " each other.",
    )


def _panel(axis: AxisGear) -> Panel:
    return Panel(
        x=Axis("frequency", "Hz", log=True),
        y=Axis("torque over velocity", axis.damping_unit, log=True),
        lines=(
            Line("predicted", axis.frequency_hz, axis.predicted, "orange", width=3.2),
            Line("measured", axis.frequency_hz, axis.measured, "ink", points=True),
        ),
        title=axis.joint,
    )


def _interval(value: float | None, sigma: float | None) -> Interval | str:
    return NOT_SHOWN if value is None or sigma is None else Interval.of(value, sigma)
