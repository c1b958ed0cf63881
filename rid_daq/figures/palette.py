"""The colours of the figures, light and dark, and how joints are told apart without colour.

The hues are those of Okabe and Ito, which colour-blind people tell apart; curves that are compared
differ in lightness, width, dash or marker besides, so that they differ in grey too.
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
"""The colours by the names that declared plots use."""

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
    """How a joint's lines are drawn."""

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


def stroke(number: int) -> Stroke:
    """Return how the lines of the joint of this number, from 0, are drawn."""
    return _STROKES[number % len(_STROKES)]


def dark_colours() -> dict[str, str]:
    """Return the dark colour of every light one."""
    return dict(_DARK)


def darkened(value: Any) -> Any:
    """Return a JSON value in which every light colour of this palette is the dark one."""
    if isinstance(value, str):
        return _DARK.get(value, value)
    if isinstance(value, dict):
        return {key: darkened(child) for key, child in value.items()}
    if isinstance(value, (list, tuple)):
        return [darkened(child) for child in value]
    return value
