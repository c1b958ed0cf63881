"""Colours of the drawings as CSS variables, for light and dark pages."""

from __future__ import annotations

from typing import Final

from rid_daq.figures.palette import GRID, NAMED, PAPER, dark_colours

NAMES: Final = {
    **{colour: name for name, colour in NAMED.items()}, GRID: "grid", PAPER: "paper",
}  # fmt: skip
"""Name of the CSS variable of each light colour."""


def colours(*, dark: bool) -> str:
    """Return the colours of the drawings as CSS custom properties."""
    own = dark_colours() if dark else {colour: colour for colour in NAMES}
    return " ".join(f"--{name}: {own[colour]};" for colour, name in NAMES.items())
