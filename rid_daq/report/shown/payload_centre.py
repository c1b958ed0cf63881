"""`centre_plot`: where the centre of gravity of a payload is, in three views of the flange."""

from __future__ import annotations

from typing import Final

import numpy as np

from rid_daq.blocks.plot import Axis, Colour, Line, Mark, Panel, Plot
from rid_daq.report.shown.centre_of_gravity import CentreOfGravity, ellipse

AXES: Final = "xyz"
VIEWS: Final = ((0, 2), (1, 2), (0, 1))
AXIS_SHARE: Final = 0.3
"""Length of the drawn axes, as a share of the distance to the centre of gravity."""
LEAST_MM: Final = 50.0
_COLOURS: Final[tuple[Colour, ...]] = ("red", "green", "blue")


def centre_plot(drawn: CentreOfGravity) -> Plot:
    """Return the flange's axes, the centre with its intervals, and the size of the payload.

    Parameters
    ----------
    drawn : CentreOfGravity
        Of a payload; without a covariance there is no ellipse.
    """
    return Plot(
        name="payload",
        panels=tuple(_view(drawn, *view) for view in VIEWS),
        caption="The centre of gravity in the frame of the flange, to scale. Even density: the"
        " ellipsoid of even density with the mass and inertia of the payload, which is at least"
        " about as large.",
        columns=len(VIEWS),
    )


def _view(drawn: CentreOfGravity, across: int, up: int) -> Panel:
    pair = [across, up]
    centre, reach = drawn.centre_mm[pair], 2.0 * drawn.sigma_mm[pair]
    length = AXIS_SHARE * max(LEAST_MM, float(np.linalg.norm(np.nan_to_num(centre))))
    lines = []
    if np.isfinite(centre).all():
        if drawn.spread_mm2 is not None:
            x, y = ellipse(centre, drawn.spread_mm2[np.ix_(pair, pair)]).tolist()
            lines.append(Line(label="even density", x=x, y=y, stroke="sky", is_area=True))
        if drawn.covariance_mm2 is not None:
            x, y = ellipse(centre, 4.0 * drawn.covariance_mm2[np.ix_(pair, pair)]).tolist()
            lines.append(Line(label="ellipse 2σ", x=x, y=y, stroke="orange"))
        lines.append(
            Line(
                label="centre ± 2σ",
                x=centre[:1].tolist(),
                y=centre[1:].tolist(),
                stroke="ink",
                points=True,
                reach=reach[1:].tolist(),
                reach_x=reach[:1].tolist(),
            )
        )
    marks = []
    for k, tip in ((across, (length, 0.0)), (up, (0.0, length))):
        lines.append(
            Line(
                label=f"{AXES[k]} axis",
                x=(0.0, tip[0]),
                y=(0.0, tip[1]),
                stroke=_COLOURS[k],
                width=3.0,
                is_named=False,
            )
        )
        marks.append(Mark(x=tip[0], y=tip[1], text=AXES[k], colour=_COLOURS[k]))
    return Panel(
        x=Axis(label=f"{AXES[across]} of the flange", unit="mm"),
        y=Axis(label=f"{AXES[up]} of the flange", unit="mm"),
        lines=tuple(lines),
        marks=tuple(marks),
        height_px=320,
        is_to_scale=True,
        title=_title(drawn, pair),
    )


def _title(drawn: CentreOfGravity, pair: list[int]) -> str:
    (along,) = {0, 1, 2} - set(pair)
    missing = [AXES[k] for k in pair if not np.isfinite(drawn.centre_mm[k])]
    unseen = f": {' and '.join(missing)} not shown by the motion" if missing else ""
    return f"seen along {AXES[along]}{unseen}"
