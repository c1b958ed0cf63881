"""`STYLE`: the matplotlib style of drawings; `as_svg`: a figure as SVG for a page."""

from __future__ import annotations

import io
import re
from typing import Any

from markupsafe import Markup
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from rid_daq.figures.palette import LIGHT
from rid_daq.report_page.drawings.page_colours import NAMES
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


def as_svg(figure: Figure, name: str) -> Markup:
    """Return a figure as an SVG element.

    The prefix `name` makes the ids in the element unique on the page. The colours are CSS variables
    (`colours`), so that they follow the light or dark page.
    """
    buffer = io.StringIO()
    # `savefig` would draw everything twice, once for the layout; `print_svg` draws once.
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})
    drawing = buffer.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r"<path (?![^>]*\bd=)[^>]*/>", "", drawing)  # remove lines without points
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = re.sub("|".join(NAMES), lambda found: f"var(--{NAMES[found[0]]})", drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')
    return Markup(
        re.sub(
            r'(<svg[^>]*?) width="[^"]*" height="[^"]*"|<metadata>.*?</metadata>\s*',
            lambda found: found.group(1) or "",
            drawing,
            flags=re.DOTALL,
        )
    )
