"""`STYLE`: the matplotlib style of figures; `drawn_text`: a text for matplotlib."""

from __future__ import annotations

from typing import Any

from rid_daq.figures.palette import LIGHT
from rid_daq.terminal.console import make_printable

STYLE: Any = {
    "svg.fonttype": "none",  # keep text as text: small, searchable, in the page's font
    "svg.hashsalt": "rid-daq",  # makes the SVG reproducible
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "text.color": LIGHT["ink"],
    "axes.labelcolor": LIGHT["ink"],
    "xtick.color": LIGHT["soft"],
    "xtick.labelcolor": LIGHT["ink"],
    "ytick.color": LIGHT["soft"],
    "ytick.labelcolor": LIGHT["ink"],
    "axes.edgecolor": LIGHT["soft"],
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LIGHT["grid"],
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
}


def drawn_text(text: str) -> str:
    """Return a text for matplotlib with visible control characters and without formulas."""
    return make_printable(text).replace("$", r"\$")
