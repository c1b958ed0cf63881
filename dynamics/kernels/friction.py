"""Values of the friction functions, each with coefficient 1, for one actuator and one sample."""

from __future__ import annotations

import math
from typing import Final

from dynamics.kernels.simd import kernel

BY_SPEED: Final = math.nan
"""Value of `direction` for a joint without presliding hysteresis: its friction follows sign(v)."""


@kernel
def friction_function(
    function: int, u: float, scale: float, smoothing: float, direction: float
) -> float:
    """Return the value of a friction function with coefficient 1.

    Args:
        function: Number of the function: 0 Coulomb, 1 viscous, 2 offset, 3 forward, 4 backward, 5
            cubic, 6 cube root, 7 Stribeck, 8 shear-thinning viscous.
        u: Velocity of the actuator, link side [rad/s or m/s].
        scale: Stribeck velocity (function 7) or shear-thinning speed (function 8) [rad/s or m/s];
            the other functions ignore it.
        smoothing: Speed [rad/s or m/s] with which tanh(v / smoothing) replaces sign(v); 0 keeps the
            discontinuous sign. The cube root is not smoothed.
        direction: Direction of motion from the presliding hysteresis, -1 to 1, which replaces
            sign(v); `BY_SPEED` for a joint without presliding.
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
    if function == 8:
        return scale * math.asinh(u / scale)
    return smooth * math.exp(-abs(u) / scale)
