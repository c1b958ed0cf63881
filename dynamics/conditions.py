"""`Conditions`: what the torque depends on besides the motion."""

from __future__ import annotations

from dataclasses import dataclass

from dynamics.kinematics import FloatArray


@dataclass(frozen=True, eq=False)
class Conditions:
    """The circumstances of a motion.

    Attributes
    ----------
    temperature_k : (samples, n) or (n,) array, or None
        Temperature of each joint's drive [K]; needed by temperature-dependent friction.
    load_nm : (samples, n) array, or None
        Signed torque that each gear transmits, link side [N m or N]; needed by transmission
        efficiency and load-dependent friction. `load_torque` computes it from parameters.
    payload : bool
        Whether the unknown payload is attached.
    """

    temperature_k: FloatArray | None = None
    load_nm: FloatArray | None = None
    payload: bool = False
