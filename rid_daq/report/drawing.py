"""What all drawings of the report share: colours, style, and their way into the page."""

from __future__ import annotations

import io
import re
from typing import Any

from matplotlib.figure import Figure

MEASURED, PREDICTED, WRONG, FAINT, GRID = "#1f2933", "#3b82f6", "#c2410c", "#b6c0cb", "#e3e8ee"

STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: small, searchable, in the page's font
    "svg.hashsalt": "rid-daq",  # the same numbers give the same bytes
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8593a3",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
}


def inline_svg(figure: Figure, name: str) -> str:
    """Return the drawing as an element to put into a page, its ids made its own."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    drawing = buffer.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    return re.sub(
        r'(<svg[^>]*?) width="[^"]*" height="[^"]*"|<metadata>.*?</metadata>\s*',
        lambda found: found.group(1) or "",
        drawing,
        flags=re.DOTALL,
    )
