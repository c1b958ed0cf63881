"""`ImportPlate`: columns of a force plate in another program's recording, and their conversion."""

from __future__ import annotations

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from acquisition.maps.time_column import Column
from acquisition.recording.plate_geometry import WRENCH_NAMES
from config.arrays import FloatArray
from config.cell.plate import (
    CHANNEL_NAMES,
    CHANNELS,
    DRIFT_LIMIT_N_S,
    PlateDescription,
    PlatePlace,
    SquareMatrix,
    SurfaceHeight,
)
from config.cell.torque_filter import ButterworthFilter
from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import Place, Positive, Turn

VOLTS: Final[dict[str, float]] = {"V": 1.0, "mV": 1e-3}
_FORCE: Final[dict[str, float]] = {"N": 1.0, "kN": 1e3}
_MOMENT: Final[dict[str, float]] = {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3}
_SIX: Final = 6
Values = Annotated[tuple[float, ...], Field(min_length=_SIX, max_length=CHANNELS)]


class ImportPlate(ConfigModel):
    """A force plate under the robot: its columns, which are all in one file, and its description.

    A reading is one of the eight channels, or one of the six components.

    Attributes:
        channels: Columns of the channels fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 of a plate with
            four three-component sensors; give this or `wrench`.
        wrench: Columns of the components Fx, Fy, Fz, Mx, My, Mz of a plate that computes them, in
            the axes of the plate's frame and about its origin.
        unit: Unit of the channels or forces; `V` and `mV` apply to moments too and need `scale`.
        moment_unit: Unit of the moments of `wrench`.
        scale: Factor of each reading, with its sign: force, or moment, per volt for the units `V`
            and `mV` [N/V, N m/V]; for other units, a correction without unit.
        exerted_on: Body on which the recorded forces act: `plate` if the columns are forces of the
            robot on the plate, `robot` for the opposite sign.
        position_m: Origin of the plate's frame in the robot's base frame; with `channels`, the
            centre of the surface.
        rotation_rad: Rotation of the plate's frame in the robot's base frame: roll, pitch and yaw
            as in a URDF. With `channels`, z points down.
        a_m: Distance of the sensors from the centre along x, as in a cell file (for `channels`).
        b_m: Distance of the sensors from the centre along y, as in a cell file (for `channels`).
        az0_m: z of the surface, measured from the sensors' plane, as in a cell file (for
            `channels`); negative.
        sensitivity: Crosstalk, as in a cell file (for `channels`).
        rate_hz: Rows per second, if the plate's file has no time stamps; its first row then has the
            time 0 [Hz].
        clock: `shared` if the plate's time stamps are on the clock of the positions; `own` for
            another clock, whose offset and rate are then estimated.
        lag_s: Delay of the plate's signals behind the positions, in addition to `low_pass` [s];
            `estimate` if it is unknown.
        rest_s: First and last time of a rest of the robot, relative to the first row of the run
            [s]. The mean reading in this interval is subtracted as the offset.
        offset: Offset of each reading, in the unit of its column; it is subtracted.
        saturation: Absolute value at which each reading saturates, in the unit of its column. From
            95 % of this value, the reading is not used.
        low_pass: Low-pass of the plate's amplifier, which is compensated.
        drift_limit_n_s: A period in which a reading drifts faster is not averaged [N/s or N m/s].
    """

    channels: Annotated[tuple[Column, ...], Field(max_length=CHANNELS)] = ()
    wrench: Annotated[tuple[Column, ...], Field(max_length=_SIX)] = ()
    unit: Literal["N", "kN", "V", "mV"] = "N"
    moment_unit: Literal["Nm", "kNm", "Nmm"] = "Nm"
    scale: Annotated[Values, Plausible(1e-3, 1e6, "N/V, N m/V or no unit")] | None = None
    exerted_on: Literal["plate", "robot"] = "plate"
    position_m: Place
    rotation_rad: Turn
    a_m: Annotated[Positive, Plausible(5e-3, 2.0, "m")] | None = None
    b_m: Annotated[Positive, Plausible(5e-3, 2.0, "m")] | None = None
    az0_m: SurfaceHeight | None = None
    sensitivity: SquareMatrix | None = None
    rate_hz: Annotated[Positive, Plausible(1.0, 1e5, "Hz")] | None = None
    clock: Literal["shared", "own"] = "shared"
    lag_s: Annotated[float, Plausible(0.0, 10.0, "s")] | Literal["estimate"] = 0.0
    rest_s: Annotated[tuple[float, float], Plausible(0.0, 1e5, "s")] | None = None
    offset: Annotated[Values, Plausible(0.0, 1e6, "N, N m or V")] | None = None
    saturation: Annotated[Values, Plausible(1e-3, 1e6, "N, N m or V")] | None = None
    low_pass: ButterworthFilter | None = None
    drift_limit_n_s: Annotated[Positive, Plausible(1e-4, 1e3, "N/s")] = DRIFT_LIMIT_N_S

    @model_validator(mode="after")
    def _check_columns(self) -> ImportPlate:
        counts = (len(self.channels), len(self.wrench))
        if counts not in ((CHANNELS, 0), (0, _SIX)):
            raise ValueError(
                "give either channels, the columns of the eight channels"
                f" {', '.join(CHANNEL_NAMES)}, or wrench, the columns of the six components"
                f" {', '.join(WRENCH_NAMES)}"
            )
        for key in ("scale", "offset", "saturation"):
            values = getattr(self, key)
            if values is not None and len(values) != len(self.columns):
                raise ValueError(
                    f"{key} has {len(values)} values: give one for each of the"
                    f" {len(self.columns)} readings, in the order of the columns"
                )
        if self.saturation is not None and min(self.saturation) <= 0.0:
            raise ValueError("saturation must be positive")
        if self.scale is None and self.unit in VOLTS:
            raise ValueError(
                f"unit {self.unit} needs scale, the force or moment per volt of each reading"
            )
        if self.scale is not None and 0.0 in self.scale:
            raise ValueError("scale of a reading is 0: give the value of its calibration")
        return self

    @model_validator(mode="after")
    def _check_description(self) -> ImportPlate:
        sizes = ("a_m", "b_m", "az0_m")
        given = [key for key in (*sizes, "sensitivity") if getattr(self, key) is not None]
        if self.wrench and given:
            raise ValueError(f"{', '.join(given)}: only for a plate with channels; remove it")
        if self.channels and not set(sizes) <= set(given):
            raise ValueError("channels need a_m, b_m and az0_m: see the plate's certificate")
        if self.rest_s is not None and self.offset is not None:
            raise ValueError("rest_s and offset both define the offset: give one of them")
        if self.rest_s is not None and not self.rest_s[0] < self.rest_s[1]:
            raise ValueError("rest_s: the first time must be before the last")
        if self.clock == "own" and self.lag_s not in (0.0, "estimate"):
            raise ValueError(
                "with clock: own the lag is estimated together with the clock: remove lag_s"
            )
        _ = self.description  # checks the crosstalk
        return self

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the readings."""
        return self.channels or self.wrench

    @property
    def reading_names(self) -> tuple[str, ...]:
        """Names of the readings."""
        return CHANNEL_NAMES if self.channels else WRENCH_NAMES

    @property
    def column_key(self) -> str:
        """Key that has the columns: `channels` or `wrench`."""
        return "channels" if self.channels else "wrench"

    @property
    def description(self) -> PlatePlace:
        """Place of the plate; with channels, also its sizes and crosstalk."""
        place = {"position_m": self.position_m, "rotation_rad": self.rotation_rad}
        if not self.channels:
            return PlatePlace.model_validate(place)
        sizes = {"a_m": self.a_m, "b_m": self.b_m, "az0_m": self.az0_m}
        return PlateDescription.model_validate(place | sizes | {"sensitivity": self.sensitivity})

    @property
    def factors(self) -> FloatArray:
        """SI value on the plate per unit of each column, (c,) [N, N m]."""
        sign = 1.0 if self.exerted_on == "plate" else -1.0
        scale = np.ones(len(self.columns)) if self.scale is None else np.array(self.scale)
        if self.unit in VOLTS:
            return sign * VOLTS[self.unit] * scale
        units = np.full(len(self.columns), _FORCE[self.unit])
        if self.wrench:
            units[3:] = _MOMENT[self.moment_unit]
        return sign * units * scale

    @property
    def is_estimated(self) -> bool:
        """True if the plate's lag is estimated and compensated by the import."""
        return self.clock == "own" or self.lag_s == "estimate"
