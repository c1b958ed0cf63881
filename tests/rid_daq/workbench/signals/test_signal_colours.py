"""Viewers with any kind of colour vision can distinguish the joints' lines from each other and from
the background, in both themes.
"""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from rid_daq.workbench.static_files import static_files

LEAST_CONTRAST = 3.0
"""Minimum contrast of parts of graphics: WCAG 2.1, success criterion 1.4.11."""

LEAST_DISTANCE = 0.07
"""Minimum distance of two colours in Oklab; a barely visible difference is about 0.02."""

# Machado, Oliveira, Fernandes (2009): matrices of full colour blindness, for linear RGB
VISIONS = {
    "full": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}


def colours(sheet: str, pattern: str, *, dark: bool) -> dict[str, NDArray[np.float64]]:
    """Return custom properties of a style sheet as linear RGB."""
    light_part, _, dark_part = static_files()[sheet].decode().partition("@media (prefers-color")
    found = re.findall(rf"--({pattern}): #([0-9a-f]{{3,6}});", dark_part if dark else light_part)
    return {name: linear(value) for name, value in found}


def linear(value: str) -> NDArray[np.float64]:
    digits = value if len(value) == 6 else "".join(2 * each for each in value)
    srgb = np.array([int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)])
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def oklab(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a colour in Oklab (Ottosson 2020)."""
    cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    opponents = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    return opponents @ np.cbrt(cones @ np.clip(rgb, 0.0, 1.0))


def luminance(rgb: NDArray[np.float64]) -> float:
    return float(rgb @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_every_line_is_visible_on_its_ground(dark: bool) -> None:
    (ground,) = colours("shell.css", "ground", dark=dark).values()
    lines = colours("signals.css", r"line-\d", dark=dark)
    assert len(lines) == 8
    for name, line in lines.items():
        bright, low = sorted((luminance(ground), luminance(line)), reverse=True)
        assert (bright + 0.05) / (low + 0.05) >= LEAST_CONTRAST, name


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_any_two_lines_differ_for_every_vision(dark: bool, vision: str) -> None:
    lines = colours("signals.css", r"line-\d", dark=dark)
    seen = {name: oklab(VISIONS[vision] @ line) for name, line in lines.items()}
    pairs = {
        (a, b): round(float(np.linalg.norm(seen[a] - seen[b])), 4) for a, b in combinations(seen, 2)
    }
    assert {pair: each for pair, each in pairs.items() if each < LEAST_DISTANCE} == {}
