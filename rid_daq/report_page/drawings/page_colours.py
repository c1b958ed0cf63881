"""Colours of the drawings as CSS variables, for light and dark pages."""

from __future__ import annotations

from typing import Final

from rid_daq.figures.palette import DARK, LIGHT

NAMES: Final = {colour: name for name, colour in LIGHT.items()}
"""Name of the CSS variable of each light colour."""


def colours(*, dark: bool) -> str:
    """Return the colours of the drawings as CSS custom properties."""
    return " ".join(f"--{name}: {colour};" for name, colour in (DARK if dark else LIGHT).items())
