"""Colours of the figures for light and dark pages, and line styles of joints.

The hues are those of Okabe and Ito, which colour-blind people can distinguish. Curves that are
compared also differ in lightness, width, dash or marker, so that they remain distinguishable in
grey.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from rid_daq.blocks.plot import Colour, Dash, Line

LIGHT: Final[Mapping[Colour | Literal["grid", "paper"], str]] = MappingProxyType(
    {
        "ink": "#1b2530",
        "soft": "#5b6875",
        "faint": "#a9b4bf",
        "grid": "#e1e7ed",
        "paper": "#ffffff",
        "blue": "#0072b2",
        "sky": "#3a9bd6",
        "orange": "#e69f00",
        "green": "#00805e",
        "red": "#c8500a",
        "purple": "#a8558a",
    }
)
"""Colours of light pages by name."""

DARK: Final[Mapping[Colour | Literal["grid", "paper"], str]] = MappingProxyType(
    {
        "ink": "#e9eef3",
        "soft": "#a3b0bd",
        "faint": "#65727f",
        "grid": "#2c3743",
        "paper": "#141b22",
        "blue": "#4aa8e0",
        "sky": "#8accf5",
        "orange": "#b87700",
        "green": "#2fb891",
        "red": "#ff7f3f",
        "purple": "#d68fbc",
    }
)
"""Colours of dark pages by name."""


class Stroke(NamedTuple):
    """Colour and dash of a line."""

    colour: Colour
    dash: Dash


_OF_JOINTS: Final = (
    Stroke("blue", "solid"),
    Stroke("orange", "solid"),
    Stroke("ink", "dashed"),
    Stroke("green", "dotdash"),
    Stroke("red", "dotted"),
    Stroke("purple", "dashed"),
    Stroke("soft", "solid"),
    Stroke("sky", "dotdash"),
)


def line_stroke(line: Line) -> Stroke:
    """Return colour and dash of a line; those of a joint repeat after eight joints."""
    if isinstance(line.stroke, int):
        own = _OF_JOINTS[line.stroke % len(_OF_JOINTS)]
        return own._replace(dash=line.dash or own.dash)
    return Stroke(line.stroke, line.dash or "solid")
