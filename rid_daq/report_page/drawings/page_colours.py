"""The colours that drawings name and the page gives, light or dark."""

from __future__ import annotations

from typing import Final

from rid_daq.figures.palette import GRID, NAMED, PAPER, dark_colours

NAMES: Final = {
    **{colour: name for name, colour in NAMED.items()}, GRID: "grid", PAPER: "paper",
}  # fmt: skip
"""How a drawing names each light colour."""


def colours(*, dark: bool) -> str:
    """Return the colours that drawings name, as custom properties of CSS."""
    own = dark_colours() if dark else {colour: colour for colour in NAMES}
    return " ".join(f"--{name}: {own[colour]};" for colour, name in NAMES.items())
