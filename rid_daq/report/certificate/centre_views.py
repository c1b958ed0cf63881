"""`draw_centre`: where the centre of gravity lies, in two views of the flange's axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from rid_daq.report.certificate.page import (
    BLACK,
    GREY,
    LINE,
    RED,
    SANS,
    SMALL_PT,
    CertificatePage,
)

SIDE_MM: Final = 62.0
HEIGHT_MM: Final = SIDE_MM + 16.0

_GAP_MM: Final = 28.0
_ROOM: Final = 0.18
_SMALLEST_SPAN_MM: Final = 10.0
_VIEWS: Final = (
    (0, 1, "along the flange's −z axis: z points at you"),
    (0, 2, "along the flange's +y axis: y points away from you"),
)


@dataclass(frozen=True)
class _View:
    """A square of the page, and what part of a plane it shows [mm]."""

    left: float
    top: float
    low_across: float
    low_up: float
    span: float

    def at(self, across: float, up: float) -> tuple[float, float]:
        """Return the place on the page of a point of the plane."""
        scale = SIDE_MM / self.span
        x = self.left + (across - self.low_across) * scale
        return x, self.top + SIDE_MM - (up - self.low_up) * scale


def draw_centre(page: CertificatePage, centre_m: FloatArray, two_sigma_m: FloatArray) -> None:
    """Draw the centre of gravity with its intervals below what stands on a page already.

    Parameters
    ----------
    page : CertificatePage
        The page; `HEIGHT_MM` of it are used.
    centre_m, two_sigma_m : ndarray, shape (3,)
        The centre from the flange's origin, and twice its standard deviations.
    """
    centre, reach = 1e3 * centre_m, 1e3 * two_sigma_m
    low = np.minimum(centre - reach, 0.0)
    high = np.maximum(centre + reach, 0.0)
    span = max(float(np.max(high - low)) * (1.0 + 2.0 * _ROOM), _SMALLEST_SPAN_MM)
    corner = 0.5 * (low + high) - 0.5 * span
    top = page.get_y() + 6.0
    left = page.l_margin + 8.0
    for across, up, seen in _VIEWS:
        view = _View(left, top, float(corner[across]), float(corner[up]), span)
        with page.local_context():
            _draw_plane(page, view, "xyz"[across], "xyz"[up], seen)
            _draw_point(page, view, centre[[across, up]], reach[[across, up]])
        left += SIDE_MM + _GAP_MM
    page.set_xy(page.l_margin, top + SIDE_MM + 10.0)


def _draw_plane(page: CertificatePage, view: _View, across: str, up: str, seen: str) -> None:
    """Draw the frame of a view, its lines of equal distance, and the flange's axes."""
    page.text_font(size_pt=SMALL_PT)
    page.set_xy(view.left, view.top - 5.0)
    page.cell(SIDE_MM, 4.0, f"Seen {seen}", align="C")
    page.set_font(SANS, "", 6.5)
    page.set_text_color(*GREY)
    step = _step(view.span)
    page.set_draw_color(225, 225, 225)
    page.set_line_width(0.1)
    for value in _ticks(view.low_across, view.span, step):
        x, _ = view.at(value, view.low_up)
        page.line(x, view.top, x, view.top + SIDE_MM)
        page.set_xy(x - 8.0, view.top + SIDE_MM + 0.6)
        page.cell(16.0, 3.0, _distance(value), align="C")
    for value in _ticks(view.low_up, view.span, step):
        _, y = view.at(view.low_across, value)
        page.line(view.left, y, view.left + SIDE_MM, y)
        page.set_xy(view.left - 13.0, y - 1.5)
        page.cell(12.0, 3.0, _distance(value), align="R")
    page.set_draw_color(*LINE)
    page.rect(view.left, view.top, SIDE_MM, SIDE_MM)
    page.set_draw_color(*BLACK)
    page.set_line_width(0.35)
    x, y = view.at(0.0, 0.0)
    page.line(view.left, y, view.left + SIDE_MM, y)
    page.line(x, view.top, x, view.top + SIDE_MM)
    page.circle(x, y, 0.9, style="D")
    page.text_font("B", SMALL_PT)
    page.text(view.left + SIDE_MM - 3.0, y - 1.2, across)
    page.text(x + 1.2, view.top + 3.4, up)
    page.text_font(size_pt=6.5)
    page.set_text_color(*GREY)
    page.set_xy(view.left, view.top + SIDE_MM + 3.6)
    page.cell(SIDE_MM, 3.0, f"{across} across, {up} up [mm]", align="C")


def _draw_point(page: CertificatePage, view: _View, centre: FloatArray, reach: FloatArray) -> None:
    """Draw a point with a bar of its interval in each direction."""
    (left, bottom), (right, top) = view.at(*(centre - reach)), view.at(*(centre + reach))
    x, y = view.at(*centre)
    page.set_draw_color(*RED)
    page.set_fill_color(*RED)
    page.set_line_width(0.4)
    page.line(left, y, right, y)
    page.line(x, bottom, x, top)
    for end in (left, right):
        page.line(end, y - 1.0, end, y + 1.0)
    for end in (bottom, top):
        page.line(x - 1.0, end, x + 1.0, end)
    page.circle(x, y, 0.7, style="F")


def _step(span: float) -> float:
    """Return a round distance of which four to nine fit into a span."""
    power = 10.0 ** math.floor(math.log10(span / 4.0))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= span / 4.0)


def _ticks(low: float, span: float, step: float) -> list[float]:
    first, last = math.ceil(low / step), math.floor((low + span) / step)
    return [step * i for i in range(first, last + 1)]


def _distance(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
