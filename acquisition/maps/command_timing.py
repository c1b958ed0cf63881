"""`CommandTiming`: relation of recorded velocity commands to the drives' velocity controllers."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from config.arrays import FloatArray
from config.model import ConfigModel
from config.plausible import Plausible


class CommandTiming(ConfigModel):
    """Time at which the drives use a recorded velocity command.

    Attributes:
        interpolation: `none` if the columns are the set-points of the velocity controllers
            themselves, sampled with the positions; `step` if a command applies until the next one;
            `linear` if the drive approaches a command linearly until the next one.
        delay_s: Time from the stamp of a row until the drive begins to use its command [s].
    """

    interpolation: Literal["none", "step", "linear"] = "none"
    delay_s: Annotated[float, Field(ge=0.0), Plausible(0.0, 0.2, "s")] = 0.0

    def response(self, frequency_hz: FloatArray, step_s: float) -> NDArray[np.complex128]:
        """Return the frequency response from recorded commands to the controllers' set-points.

        The response to one command is a pulse for `step`, and a triangle that is two rows wide for
        `linear`.

        Args:
            frequency_hz: Shape (lines,). Frequencies [Hz].
            step_s: Time between rows [s].
        """
        order = {"none": 0, "step": 1, "linear": 2}[self.interpolation]
        late = np.exp(-2j * np.pi * frequency_hz * (self.delay_s + 0.5 * order * step_s))
        return np.asarray(np.sinc(frequency_hz * step_s) ** order * late, dtype=complex)
