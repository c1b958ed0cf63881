"""`Reaction`: what a force plate under the robot measured, on the recording's own times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.signals.clocks import DeviceClock
from acquisition.signals.resampling import resample
from config.arrays import BoolArray, FloatArray, freeze
from config.cell.cell import ButterworthFilter
from config.cell.plate import CHANNEL_NAMES, PlateConfig
from config.errors import RecordingError


@dataclass(frozen=True, eq=False)
class Reaction:
    """The channels of a force plate beside a `Recording`, row by row.

    Attributes:
        channel_names: The c channels.
        channels_n: Shape (samples, c). Readings at the recording's times [N].
        valid: Shape (samples, c). False where a channel was in overload or delivered nothing.
        base_wrench_matrix: Shape (6, c). The wrench on the robot's base per unit reading; see
            `PlateGeometry`.
        low_pass: The filter that the channels passed.
        clock: The plate's clock on the recording's time base, where it has its own.
        drift_limit_n_s: A period in which a channel drifts faster is not averaged [N/s].
    """

    channel_names: tuple[str, ...]
    channels_n: FloatArray
    valid: BoolArray
    base_wrench_matrix: FloatArray
    low_pass: ButterworthFilter | None = None
    clock: DeviceClock | None = None
    drift_limit_n_s: float = math.inf

    def __post_init__(self) -> None:
        c = len(self.channel_names)
        freeze(self, RecordingError, (None, c), "channels_n", what="reaction ")
        freeze(self, RecordingError, (len(self), c), "valid", what="reaction ", dtype=np.bool_)
        freeze(self, RecordingError, (6, c), "base_wrench_matrix")

    def __len__(self) -> int:
        return len(self.channels_n)

    @property
    def base_wrench(self) -> FloatArray:
        """The wrench on the robot's base, offsets included, shape (samples, 6) [N, N m]."""
        return np.asarray(self.channels_n @ self.base_wrench_matrix.T)


def reaction_of(
    plate: PlateConfig,
    clock: DeviceClock,
    device_s: FloatArray,
    channels_n: FloatArray,
    valid: BoolArray,
    sync_s: FloatArray,
) -> Reaction:
    """Put the rows of a plate's amplifier on the recording's times.

    Args:
        plate: The plate and its amplifier; a `zero` in it is subtracted.
        clock: The amplifier's clock.
        device_s: Shape (rows,). Device time of each row, increasing [s].
        channels_n: Shape (rows, 8). Readings [N].
        valid: Shape (rows, 8). False where a channel was in overload.
        sync_s: Shape (samples,). The recording's times [s].

    Raises:
        DataQualityError: The rows are not on a regular grid.
        RecordingError: The shapes do not fit.
    """
    if np.shape(channels_n) != (len(device_s), len(CHANNEL_NAMES)):
        raise RecordingError(
            f"{len(device_s)} rows of the plate with readings of the shape {np.shape(channels_n)}",
            code="RID-API-ARGUMENT",
        )
    readings = channels_n if plate.zero is None else channels_n - np.array(plate.zero.offset_n)
    cycle_s = (
        float(np.median(np.diff(sync_s))) if len(sync_s) > 1 else 1.0 / plate.amplifier.rate_hz
    )
    samples, good = resample(clock.to_sync(device_s), readings, valid, sync_s, 1.0 / cycle_s)
    return Reaction(
        channel_names=CHANNEL_NAMES,
        channels_n=samples,
        valid=good,
        base_wrench_matrix=PlateGeometry.from_config(plate).base_wrench_matrix,
        low_pass=ButterworthFilter(
            order=plate.amplifier.low_pass_order, cutoff_hz=plate.amplifier.low_pass_hz
        ),
        clock=clock,
        drift_limit_n_s=plate.drift_limit_n_s,
    )
