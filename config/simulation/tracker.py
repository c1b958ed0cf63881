"""`SimulatedTracker`: a laser tracker that measures a point on the simulated robot."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import NonNegative, Place, Turn


class SimulatedTracker(ConfigModel):
    """A laser tracker; `rid-daq record --tracker FILE` writes what it measures.

    Attributes:
        rate_hz: Rate of the measurements.
        point_m: The measured point in the frame of the last link.
        noise_m: Standard deviation of each coordinate.
        position_m: Position of the tracker in frame 0.
        rotation_rad: Rotation vector of the tracker's frame in frame 0.
        clock_offset_s: Time that the tracker's clock shows when the robot is switched on.
        clock_ppm: Error of the clock; positive if it runs fast.
    """

    rate_hz: Annotated[float, Field(ge=1.0, le=5000.0)] = 250.0
    point_m: Place
    noise_m: Annotated[NonNegative, Plausible(0.0, 0.01, "m")] = 5e-5
    position_m: Place = (2.5, 0.0, 0.0)
    rotation_rad: Turn = (0.0, 0.0, 0.0)
    clock_offset_s: float = 0.0
    clock_ppm: Annotated[float, Field(ge=-10_000.0, le=10_000.0)] = 0.0
