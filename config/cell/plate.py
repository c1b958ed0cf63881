"""`PlateConfig`: the force plate under the robot; `AmplifierConfig`: its charge amplifier.

The channels are fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4; every array of eight values has this
order.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import Place, Positive, Turn

CHANNELS: Final = 8
CHANNEL_NAMES: Final = ("fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4")
WORST_CROSSTALK: Final = 1e3
LARGEST_CROSSTALK: Final = 0.5
"""Largest plausible deviation of an element of the crosstalk matrix from the unit matrix."""
DRIFT_LIMIT_N_S: Final = 0.5
"""Default of the drift from which on a period is not averaged [N/s]."""


def _refuse_upward(value: object) -> object:
    """Return the z coordinate of a plate's surface; raise ValueError if it is positive."""
    if isinstance(value, int | float) and not isinstance(value, bool) and value > 0.0:
        raise ValueError(
            f"{value:g} m would be a surface below the sensors, because z of a plate points down:"
            f" write {-value:g}"
        )
    return value


Eight = Annotated[tuple[float, ...], Field(min_length=CHANNELS, max_length=CHANNELS)]
Force = Annotated[Positive, Plausible(0.1, 1e6, "N")]
Moment = Annotated[Positive, Plausible(0.1, 1e6, "N m")]
EightForces = Annotated[tuple[Force, ...], Field(min_length=CHANNELS, max_length=CHANNELS)]
EightSensitivities = Annotated[
    tuple[Annotated[float, Plausible(0.1, 500.0, "pC/N")], ...],
    Field(min_length=CHANNELS, max_length=CHANNELS),
]
EightOffsets = Annotated[
    tuple[Annotated[float, Plausible(0.0, 1e6, "N")], ...],
    Field(min_length=CHANNELS, max_length=CHANNELS),
]
EightDrifts = Annotated[
    tuple[Annotated[float, Plausible(0.0, 1e4, "N/s")], ...],
    Field(min_length=CHANNELS, max_length=CHANNELS),
]
SurfaceHeight = Annotated[
    float, BeforeValidator(_refuse_upward), Field(le=0.0), Plausible(0.0, 2.0, "m")
]
SquareMatrix = Annotated[tuple[Eight, ...], Field(min_length=CHANNELS, max_length=CHANNELS)]
ThreeForces = tuple[Force, Force, Force]
ThreeMoments = tuple[Moment, Moment, Moment]


class AmplifierConfig(ConfigModel):
    """An eight-channel charge amplifier on a serial line, with its settings.

    Attributes:
        address: Anything that pyserial opens: the path of a device, `rfc2217://host:port`,
            `socket://host:port`.
        baud_rate: Baud rate of the serial line [bit/s].
        profile: The commands and rows of this amplifier: a bundled name, or a path relative to the
            cell file.
        format: Format of the rows.
        rate_hz: Rows per second.
        low_pass_hz: Cut-off frequency of the amplifier's low-pass filter.
        low_pass_order: Order of the amplifier's low-pass filter.
        range_n: Full scale of each channel.
        sensitivity_pc_n: Sensitivities of the sensors, with their sign, as on their certificate.
        trigger: The SYNC pulse is wired to the amplifier's trigger input: the device time of each
            edge is sent with the rows, and its bytes add to the line's load.
        bits: Resolution of the converter.
    """

    address: str = Field(min_length=1, max_length=256)
    baud_rate: Annotated[int, Field(ge=300, le=12_000_000)]
    profile: str = "kistler_style"
    format: Literal["ascii", "binary"] = "binary"
    rate_hz: Annotated[float, Field(gt=0.0, le=100_000.0)]
    low_pass_hz: Annotated[Positive, Plausible(0.5, 1e5, "Hz")]
    low_pass_order: Annotated[int, Field(ge=1, le=8)] = 2
    range_n: EightForces
    sensitivity_pc_n: EightSensitivities
    trigger: bool = False
    bits: Annotated[int, Field(ge=8, le=16)] = 16

    @model_validator(mode="after")
    def _check_settings(self) -> AmplifierConfig:
        if self.low_pass_hz > self.rate_hz / 2.0:
            raise ValueError(
                f"low_pass_hz is {self.low_pass_hz:g} Hz, above half of rate_hz"
                f" ({self.rate_hz / 2.0:g} Hz), so that frequencies between them would alias;"
                " lower low_pass_hz or raise rate_hz"
            )
        if 0.0 in self.sensitivity_pc_n:
            channel = CHANNEL_NAMES[self.sensitivity_pc_n.index(0.0)]
            raise ValueError(f"sensitivity_pc_n of {channel} is 0; give the sensor's value")
        return self

    @property
    def full_scale_counts(self) -> int:
        """Counts that correspond to `range_n`."""
        return 1 << (self.bits - 1)

    @property
    def newtons_per_count(self) -> Eight:
        """Force that corresponds to one count, per channel [N]."""
        return tuple(range_n / self.full_scale_counts for range_n in self.range_n)


class PlateZero(ConfigModel):
    """Result of `rid-daq plate zero`: each channel's offset and its drift.

    Attributes:
        offset_n: Offset of each channel.
        drift_n_s: Drift of each channel.
        pose: The robot's pose at the end of the measurement [rad or m], base to flange.
        rest_n: Reading of the channels in this pose in addition to the offset, caused by the moment
            of gravity.
    """

    offset_n: EightOffsets
    drift_n_s: EightDrifts = (0.0,) * CHANNELS
    pose: tuple[Annotated[float, Plausible(0.0, 50.0, "rad or m")], ...] = ()
    rest_n: EightOffsets = (0.0,) * CHANNELS


class PlateLimits(ConfigModel):
    """Load limits of the floor, about the axes of the robot's base, for either sign.

    Attributes:
        force_n: Largest force in x, y and z.
        moment_nm: Largest moment about x, y and z.
    """

    force_n: ThreeForces
    moment_nm: ThreeMoments


class PlatePlace(ConfigModel):
    """Pose of a force plate. Alone, it describes a plate whose own software computes the wrench.

    Attributes:
        position_m: Origin of the plate's frame (the centre of the surface) in the robot's base
            frame.
        rotation_rad: Rotation of the plate's frame in the robot's base frame: roll, pitch and yaw
            as in a URDF.
    """

    position_m: Place
    rotation_rad: Turn


class PlateDescription(PlatePlace):
    """A force plate of four three-component sensors, as C3D's FORCE_PLATFORM type 3 defines it.

    Attributes:
        a_m: Distance of the sensors from the centre along the plate's x, as on its certificate.
        b_m: Distance of the sensors from the centre along the plate's y, as on its certificate.
        az0_m: z of the surface, measured from the sensors' plane, as on the certificate; it is
            negative, because the plate's z points down.
        sensitivity: The crosstalk: channel readings = matrix times sensor forces.
    """

    a_m: Annotated[Positive, Plausible(5e-3, 2.0, "m")]
    b_m: Annotated[Positive, Plausible(5e-3, 2.0, "m")]
    az0_m: SurfaceHeight
    sensitivity: SquareMatrix | None = None

    @model_validator(mode="after")
    def _check_sensitivity(self) -> PlateDescription:
        if self.sensitivity is not None:
            sizes = np.linalg.svd(np.array(self.sensitivity), compute_uv=False)
            if sizes[-1] * WORST_CROSSTALK < sizes[0]:
                raise ValueError(
                    "sensitivity cannot be inverted reliably, because its rows, one per channel,"
                    " are almost dependent; correct it"
                )
            deviations = np.abs(np.array(self.sensitivity) - np.eye(CHANNELS))
            row, column = np.unravel_index(int(deviations.argmax()), deviations.shape)
            if deviations[row, column] > LARGEST_CROSSTALK:
                raise ValueError(
                    f"sensitivity of {CHANNEL_NAMES[row]} to the force of {CHANNEL_NAMES[column]}"
                    f" is {self.sensitivity[row][column]:g}; the matrix has no unit, about 1 on its"
                    f" diagonal and 0 elsewhere (within {LARGEST_CROSSTALK:g}): divide pC/N or V/N"
                    " by the channel's nominal sensitivity, or correct the order of the channels"
                )
        return self


class PlateConfig(PlateDescription):
    """The force plate of a cell, with its charge amplifier.

    Attributes:
        zero: Result of `rid-daq plate zero`.
        drift_limit_n_s: A period in which a channel drifts faster is not averaged.
        limits: Load limits of the floor.
        amplifier: The charge amplifier.
    """

    zero: PlateZero | None = None
    drift_limit_n_s: Annotated[Positive, Plausible(1e-4, 1e3, "N/s")] = DRIFT_LIMIT_N_S
    limits: PlateLimits | None = None
    amplifier: AmplifierConfig

    @model_validator(mode="after")
    def _check_zero(self) -> PlateConfig:
        offsets = () if self.zero is None else self.zero.offset_n
        ranges = self.amplifier.range_n
        for name, offset_n, range_n in zip(CHANNEL_NAMES, offsets, ranges, strict=False):
            if abs(offset_n) > range_n:
                raise ValueError(
                    f"zero.offset_n of {name} is {offset_n:g} N, beyond the channel's range_n,"
                    f" {range_n:g} N: measure the zero again with `plate zero`, or correct range_n"
                )
        return self
