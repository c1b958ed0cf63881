"""`Conditions`: quantities on which the torque depends, besides positions and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray
from dynamics.terms.memory import Memory


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions of a motion.

    Attributes:
        temperature_k: Shape (samples, n) or (n,). Temperature of each joint's drive [K]; required
            by temperature-dependent friction.
        load_nm: Shape (samples, n). Signed torque that each gear transmits, link side [N m or N];
            required by gear efficiencies and load-dependent friction. `load_torque` computes it.
        payload: True if the payload with unknown parameters is attached.
        memory: Hysteretic directions of motion; if None, friction with presliding follows sign(v).
            `dynamics.model.memory` computes them along a motion.
    """

    temperature_k: FloatArray | None = None
    load_nm: FloatArray | None = None
    payload: bool = False
    memory: Memory | None = None

    def part(self, samples: slice) -> Conditions:
        """Return the conditions for a range of samples."""
        temperature, load = self.temperature_k, self.load_nm
        if temperature is not None and np.ndim(temperature) == 2:
            temperature = temperature[samples]
        return replace(
            self,
            temperature_k=temperature,
            load_nm=None if load is None else load[samples],
            memory=None if self.memory is None else self.memory.part(samples),
        )
