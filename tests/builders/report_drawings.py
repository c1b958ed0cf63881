"""Reports without plots and pictures.

Drawing takes most of the time of a command that writes a report.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from rid_daq.blocks.block import Text

LEFT_OUT = Text(text="The robot is not drawn in this test.")


@contextmanager
def without_drawings() -> Iterator[pytest.MonkeyPatch]:
    """Let reports of this process contain all texts and tables, but no plots and pictures.

    Yields:
        The patch; its `undo` restores the drawings.
    """
    with pytest.MonkeyPatch.context() as patch:
        leave_out_drawings(patch)
        yield patch


def leave_out_drawings(patch: pytest.MonkeyPatch) -> None:
    """Replace the functions that draw a report's plots and pictures by constants."""
    from rid_daq.report_page import render
    from rid_daq.report_page.live_figures import LiveFigures
    from rid_daq.robot_view import robot_pictures

    patch.setitem(render._environment().globals, "_plot_svg", lambda _plot, _name: "")
    patch.setattr(LiveFigures, "add", lambda _figures, _plot: "")
    for name in ("robot_picture", "flange_picture"):
        patch.setattr(robot_pictures, name, lambda *_of: LEFT_OUT)
