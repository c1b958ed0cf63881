"""`friction_blocks`: measured friction, and the models fitted to it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import Final

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cells, Heading, Interval, Table, Text, Verdict, table
from rid_daq.blocks.formats import format_measured, number, unit
from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Marker, Panel, Plot
from rid_daq.report.sections.friction import (
    ComparedFriction,
    FrictionModel,
    FrictionSection,
    JointFriction,
)

STROKES: Final[tuple[tuple[Colour, Dash], ...]] = (
    ("orange", "solid"),
    ("blue", "dashed"),
    ("purple", "dotdash"),
)
OTHERS: Final[tuple[Colour, ...]] = ("green", "red", "sky")
"""Colours of other runs beside the measured friction."""


def friction_blocks(section: FrictionSection) -> Iterator[AnyBlock]:
    """Yield the friction curves, and for each joint its values, models and fit."""
    yield Heading(text="Measured friction")
    yield Text(text=section.sentence)
    yield friction_plot(section)
    for joint in section.joints:
        yield Heading(text=joint.joint, level=3)
        yield _curve(joint)
        for other in joint.beside or ():
            yield _other_curve(other, joint)
        yield _models(joint)
        if joint.grade is not None:
            yield _fit(joint)
        yield Text(text=joint.sentence)


def friction_plot(section: FrictionSection) -> Plot:
    """Return measured friction ± 2σ over speed, and the models, one panel per joint."""
    return Plot(name="friction", panels=tuple(_panel(joint) for joint in section.joints), columns=3)


def _panel(joint: JointFriction) -> Panel:
    curve, drawn = joint.curve, joint.lines
    reach = tuple(2.0 * std for std in curve.odd_std)
    lines = [Line("measured ± 2σ", curve.speed, curve.odd, "ink", reach=reach, points=True)]
    for (name, torque), (colour, dash) in zip(drawn.torque.items(), STROKES, strict=False):
        lines.append(Line(name, drawn.speed, torque, colour, dash=dash))
    for other, colour in zip(joint.beside or (), cycle(OTHERS)):
        speed, odd = other.curve.speed, other.curve.odd
        reach = tuple(2.0 * std for std in other.curve.odd_std)
        lines.append(Line(f"{other.label} ± 2σ", speed, odd, colour, reach=reach, points=True))
        lines.append(Line(other.label, speed, odd, colour, dash="dotted"))
    if curve.forward is not None and curve.backward is not None:
        opposite = tuple(-value for value in curve.backward)
        ways: tuple[tuple[str, tuple[float, ...], Marker], ...] = (
            ("forwards", curve.forward, "triangle"),
            ("backwards", opposite, "inverted_triangle"),
        )
        for way, values, marker in ways:
            lines.append(Line(way, curve.speed, values, "soft", points=True, marker=marker))
    return Panel(
        title=joint.joint,
        x=Axis("speed", f"{joint.unit}/s"),
        y=Axis("friction", joint.torque_unit),
        lines=tuple(lines),
        height_px=280,
    )


def _curve(joint: JointFriction) -> Table:
    curve, torque = joint.curve, joint.torque_unit
    ways: list[Cells[int]] = []
    if (std := curve.direction_std) is not None:
        for way, values in (("forwards", curve.forward), ("backwards", curve.backward)):
            own = [Interval.of(*each) for each in zip(values or (), std, strict=True)]
            ways.append(Cells(f"{way} ± 2σ", own.__getitem__, torque))
    return table(
        range(len(curve.speed)),
        Cells("speed", lambda i: curve.speed[i], f"{joint.unit}/s", 3),
        Cells("friction ± 2σ", lambda i: Interval.of(curve.odd[i], curve.odd_std[i]), torque),
        *ways,
    )


def _other_curve(other: ComparedFriction, joint: JointFriction) -> Table:
    curve, torque = other.curve, joint.torque_unit
    return table(
        range(len(curve.speed)),
        Cells(f"speed in {other.label}", lambda i: curve.speed[i], f"{joint.unit}/s", 3),
        Cells("friction ± 2σ", lambda i: Interval.of(curve.odd[i], curve.odd_std[i]), torque),
    )


def _models(joint: JointFriction) -> Table:
    return table(
        joint.fits,
        Cells("model", lambda fit: f"{fit.name} (best)" if fit is joint.fits[0] else fit.name),
        Cells("RMS error", lambda fit: fit.rms, joint.torque_unit, 3),
        Cells("misfit", lambda fit: fit.misfit, "σ²", 3),
        Cells("criterion", lambda fit: fit.criterion, digits=3),
        Cells("coefficients ± 2σ", _coefficients),
    )


def _coefficients(fit: FrictionModel) -> str:
    shown = ", ".join(
        f"{each.name} {' ± '.join(format_measured(each.value, 2.0 * each.std))} {unit(each.unit)}"
        for each in fit.parameters
    )
    return f"{shown} (at its bound)" if fit.at_bound else shown


def _fit(joint: JointFriction) -> Verdict:
    text = f"{joint.joint}: the fit is {joint.grade}, {joint.reason}"
    if joint.over_noise is not None:
        text += f"; its error is {number(joint.over_noise, 2)} times the noise"
    return Verdict(passed=None if joint.grade is Grade.GOOD else False, text=text)
