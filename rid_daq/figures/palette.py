"""Colours of the figures for light and dark pages, and line styles of joints.

The hues are those of Okabe and Ito, which colour-blind people can distinguish. Curves that are
compared also differ in lightness, width, dash or marker, so that they remain distinguishable in
grey.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from rid_daq.blocks.plot import Colour, Dash

INK: Final = "#1b2530"
SOFT: Final = "#5b6875"
FAINT: Final = "#a9b4bf"
GRID: Final = "#e1e7ed"
PAPER: Final = "#ffffff"
BLUE: Final = "#0072b2"
SKY: Final = "#3a9bd6"
ORANGE: Final = "#e69f00"
GREEN: Final = "#00805e"
RED: Final = "#c8500a"
PURPLE: Final = "#a8558a"

NAMED: Final[dict[Colour, str]] = {
    "ink": INK,
    "soft": SOFT,
    "faint": FAINT,
    "blue": BLUE,
    "sky": SKY,
    "orange": ORANGE,
    "green": GREEN,
    "red": RED,
    "purple": PURPLE,
}
"""Colours by their names in declared plots."""

_DARK: Final = {
    INK: "#e9eef3",
    SOFT: "#a3b0bd",
    FAINT: "#65727f",
    GRID: "#2c3743",
    PAPER: "#141b22",
    BLUE: "#4aa8e0",
    SKY: "#8accf5",
    ORANGE: "#b87700",
    GREEN: "#2fb891",
    RED: "#ff7f3f",
    PURPLE: "#d68fbc",
}


class Stroke(NamedTuple):
    """Line style of a joint: colour and dash."""

    color: str
    dash: Dash


_STROKES: Final = (
    Stroke(BLUE, "solid"),
    Stroke(ORANGE, "solid"),
    Stroke(INK, "dashed"),
    Stroke(GREEN, "dotdash"),
    Stroke(RED, "dotted"),
    Stroke(PURPLE, "dashed"),
    Stroke(SOFT, "solid"),
    Stroke(SKY, "dotdash"),
)


def joint_stroke(number: int) -> Stroke:
    """Return the line style of a joint by its number, from 0."""
    return _STROKES[number % len(_STROKES)]


def dark_colours() -> dict[str, str]:
    """Return the dark colour of every light colour."""
    return dict(_DARK)


def to_dark(value: Any) -> Any:
    """Return a JSON value in which dark colours replace the light colours of this palette."""
    if isinstance(value, str):
        return _DARK.get(value, value)
    if isinstance(value, dict):
        return {key: to_dark(child) for key, child in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_dark(child) for child in value]
    return value
