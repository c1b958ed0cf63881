"""Every drawing that templates ask for, by its name; whoever imports it loads what draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from markupsafe import Markup

from rid_daq.report_page.drawings.plot import plot_svg
from rid_daq.report_page.drawings.stop import stop_figure

DRAWINGS: Final[dict[str, Callable[..., Markup]]] = {
    draw.__name__: draw
    for draw in (
        plot_svg,
        stop_figure,
    )
}
