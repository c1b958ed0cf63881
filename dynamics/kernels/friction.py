"""Friction of one actuator at one sample, of size one."""

from __future__ import annotations

import math
from typing import Final

from dynamics.kernels.simd import kernel

BY_SPEED: Final = math.nan
"""In place of a remembered direction: the joint slides by sign(v)."""


@kernel
def friction_function(
    function: int, u: float, scale: float, smoothing: float, direction: float
) -> float:
    """Return a friction term of size one.

    Args:
        function: Which: 0 Coulomb, 1 viscous, 2 offset, 3 forward, 4 backward, 5 cubic, 6 cube
            root, 7 Stribeck.
        u: The actuator's speed.
        scale: Stribeck's speed.
        smoothing: sign(v) is tanh(v / smoothing); 0 for a hard one.
        direction: The way that a joint with presliding remembers, in place of sign(v); `BY_SPEED`
            for others.
    """
    sign = 1.0 if u > 0.0 else (-1.0 if u < 0.0 else 0.0)
    smooth = math.tanh(u / smoothing) if smoothing > 0.0 else sign
    moving = 1.0 if smoothing > 0.0 else abs(sign)
    if not math.isnan(direction):
        smooth, moving = direction, 1.0
    if function == 0:
        return smooth
    if function == 1:
        return u
    if function == 2:
        return 1.0
    if function == 3:
        return 0.5 * (smooth + moving)
    if function == 4:
        return 0.5 * (smooth - moving)
    if function == 5:
        return u * u * u
    if function == 6:
        return sign * float(abs(u) ** (1.0 / 3.0))
    return smooth * math.exp(-abs(u) / scale)
