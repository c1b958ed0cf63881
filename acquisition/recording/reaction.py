"""`Reaction`: readings of a force plate under the robot, at the recording's times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.signals.clocks import DeviceClock
from acquisition.signals.resampling import resample
from config.arrays import BoolArray, FloatArray, freeze
from config.cell.plate import CHANNEL_NAMES, PlateConfig
from config.cell.torque_filter import ButterworthFilter
from config.errors import RecordingError


@dataclass(frozen=True, eq=False)
class Reaction:
    """Channels of a force plate, row by row as in the `Recording`.

    Attributes:
        channel_names: Names of the c channels.
        channels_n: Shape (samples, c). Readings at the recording's times [N; N m for moments].
        valid: Shape (samples, c). False if the channel was in overload or delivered no value.
        base_wrench_matrix: Shape (6, c). Wrench on the robot's base per unit reading; see
            `PlateGeometry`.
        low_pass: Low-pass filter of the channels.
        clock: Clock of the plate relative to the recording's time base, if it has its own clock.
        drift_limit_n_s: A period is not averaged if a channel drifts faster [N/s].
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
        """Wrench on the robot's base, (samples, 6) [N, N m]; offsets of `channels_n` act on it."""
        return np.asarray(self.channels_n @ self.base_wrench_matrix.T)


def resample_reaction(
    plate: PlateConfig,
    clock: DeviceClock,
    device_s: FloatArray,
    channels_n: FloatArray,
    valid: BoolArray,
    sync_s: FloatArray,
) -> Reaction:
    """Resample the rows of a plate's amplifier to the recording's times.

    Args:
        plate: Plate and amplifier; the offsets in its `zero`, if any, are subtracted.
        clock: Clock of the amplifier.
        device_s: Shape (rows,). Device time of each row, increasing [s].
        channels_n: Shape (rows, 8). Readings [N].
        valid: Shape (rows, 8). False if the channel was in overload.
        sync_s: Shape (samples,). Times of the recording [s].

    Raises:
        DataQualityError: The rows are not on a regular grid.
        RecordingError: The shapes do not match.
    """
    if np.shape(channels_n) != (len(device_s), len(CHANNEL_NAMES)):
        raise RecordingError(
            f"readings of the plate have the shape {np.shape(channels_n)}, expected"
            f" ({len(device_s)}, {len(CHANNEL_NAMES)})",
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
