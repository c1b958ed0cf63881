"""`centre_plot`: the centre of gravity of a payload, in three views of the flange."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from config.arrays import FloatArray
from rid_daq.blocks.plot import Axis, Colour, Line, Mark, Panel, Plot

if TYPE_CHECKING:
    from identification.payload.estimate import PayloadEstimate
    from rid_daq.report.sections.payload import PayloadSection

CENTRE: Final = slice(1, 4)
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 73)
AXES: Final = "xyz"
VIEWS: Final = ((0, 2), (1, 2), (0, 1))
AXIS_SHARE: Final = 0.3
"""Length of the drawn axes, relative to the distance from the flange to the centre of gravity."""
LEAST_MM: Final = 50.0
_COLOURS: Final[tuple[Colour, ...]] = ("red", "green", "blue")


@dataclass(frozen=True, eq=False)
class CentreOfGravity:
    """Centre of gravity and size of a payload for a drawing, in the flange's frame.

    Attributes:
        centre_mm: Shape (3,). The centre of gravity; NaN for a coordinate that is not identified.
        sigma_mm: Shape (3,). Standard deviations of the coordinates; NaN if not identified.
        covariance_mm2: Shape (3, 3). Covariance of the centre; None if a result contains standard
            deviations only.
        spread_mm2: Shape (3, 3). Squared half axes, as a matrix, of the ellipsoid of uniform
            density that has the payload's mass and inertia; None unless all parameters are
            identified.
    """

    centre_mm: FloatArray
    sigma_mm: FloatArray
    covariance_mm2: FloatArray | None
    spread_mm2: FloatArray | None

    @classmethod
    def of(cls, estimate: PayloadEstimate) -> CentreOfGravity:
        """Return the values to draw for an estimate.

        Raises:
            EstimationError: No physically consistent body is close to the estimate.
        """
        from identification.payload.body import reported_slopes

        seen, sigma = np.array(estimate.is_determined[CENTRE]), estimate.sigma[CENTRE]
        slopes = reported_slopes(estimate.values)[CENTRE]
        covariance = slopes @ estimate.covariance @ slopes.T
        loose = seen & (sigma > 0.0)
        spread = None
        if estimate.rank == len(estimate.values):
            body = estimate.body
            spread = _spread(body.mass_kg, body.inertia_kg_m2)
        return cls(
            centre_mm=1e3 * estimate.reported[CENTRE],
            sigma_mm=np.where(seen, 1e3 * sigma, np.nan),
            covariance_mm2=np.where(np.outer(loose, loose), 1e6 * covariance, 0.0),
            spread_mm2=spread,
        )

    @classmethod
    def of_section(cls, section: PayloadSection) -> CentreOfGravity:
        """Return the values to draw for the payload of a result."""
        from identification.payload.body import PayloadBody

        entries = section.parameters
        centre, sigma = (
            np.array([np.nan if x is None else x for x in row], dtype=np.float64)
            for row in zip(*((each.value, each.std) for each in entries[CENTRE]), strict=True)
        )
        exported = [each.exported for each in entries]
        spread = None
        if all(value is not None for value in exported):
            body = PayloadBody.of_reported(np.array(exported, dtype=np.float64))
            spread = _spread(body.mass_kg, body.inertia_kg_m2)
        return cls(1e3 * centre, 1e3 * sigma, None, spread)


def _spread(mass_kg: float, inertia_kg_m2: FloatArray) -> FloatArray | None:
    """Return the squared half axes of an ellipsoid [mm²] as a matrix; None without a mass."""
    if mass_kg <= 0.0:
        return None
    second = 0.5 * np.trace(inertia_kg_m2) * np.eye(3) - inertia_kg_m2
    return np.asarray(1e6 * 5.0 * second / mass_kg)


def ellipse(centre: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return points (2, k) on an ellipse; `matrix` (2, 2) contains the squared half axes."""
    squares, axes = np.linalg.eigh(matrix)
    half = axes * np.sqrt(np.maximum(squares, 0.0))
    return np.asarray(centre[:, np.newaxis] + half @ np.array([np.cos(_TURN), np.sin(_TURN)]))


def centre_plot(drawn: CentreOfGravity) -> Plot:
    """Return a plot of the flange's axes, the centre with intervals, and the payload's size.

    Args:
        drawn: Values of a payload; without a covariance no ellipse is drawn.
    """
    return Plot(
        name="payload",
        panels=tuple(_view(drawn, *view) for view in VIEWS),
        caption="The centre of gravity in the frame of the flange, to scale. Uniform density:"
        " ellipsoid of uniform density with the payload's mass and inertia; the payload"
        " itself is usually at least as large.",
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
            lines.append(Line("uniform density", x, y, "sky", is_area=True))
        if drawn.covariance_mm2 is not None:
            x, y = ellipse(centre, 4.0 * drawn.covariance_mm2[np.ix_(pair, pair)]).tolist()
            lines.append(Line("ellipse 2σ", x, y, "orange"))
        lines.append(
            Line(
                "centre ± 2σ",
                centre[:1].tolist(),
                centre[1:].tolist(),
                "ink",
                points=True,
                reach=reach[1:].tolist(),
                reach_x=reach[:1].tolist(),
            )
        )
    marks = []
    for k, tip in ((across, (length, 0.0)), (up, (0.0, length))):
        lines.append(
            Line(
                f"{AXES[k]} axis",
                (0.0, tip[0]),
                (0.0, tip[1]),
                _COLOURS[k],
                width=3.0,
                is_named=False,
            )
        )
        marks.append(Mark(tip[0], tip[1], AXES[k], colour=_COLOURS[k]))
    return Panel(
        x=Axis(f"{AXES[across]} of the flange", "mm"),
        y=Axis(f"{AXES[up]} of the flange", "mm"),
        lines=tuple(lines),
        marks=tuple(marks),
        height_px=320,
        is_to_scale=True,
        title=_title(drawn, pair),
    )


def _title(drawn: CentreOfGravity, pair: list[int]) -> str:
    (along,) = {0, 1, 2} - set(pair)
    missing = [AXES[k] for k in pair if not np.isfinite(drawn.centre_mm[k])]
    unseen = f": {' and '.join(missing)} not identifiable from this motion" if missing else ""
    return f"seen along {AXES[along]}{unseen}"
