"""`Kinematics`: a robot's Denavit-Hartenberg table, and the rows used in computations."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from config.formats.rounded_angle import AngleReading, angle_notes
from config.model import ConfigModel
from config.plausible import Plausible

Angle = Annotated[float, Plausible(0.0, 6.3, "rad")]
Distance = Annotated[float, Plausible(0.0, 20.0, "m")]


class KinematicRow(ConfigModel):
    """One row of a Denavit-Hartenberg table.

    The joint position is added to `theta_rad` (revolute) or `d_m` (prismatic).

    Attributes:
        alpha_rad: Twist about x.
        beta_rad: Hayati's angle about y, for nearly parallel axes (theory: section 1); it exists in
            the modified convention only.
        theta_rad: Angle about z.
        a_m: Distance along x.
        d_m: Distance along z.
    """

    alpha_rad: Angle = 0.0
    beta_rad: Angle = 0.0
    theta_rad: Angle = 0.0
    a_m: Distance = 0.0
    d_m: Distance = 0.0


_ROW_FIELDS: Final = tuple(KinematicRow.model_fields)
_ANGLES: Final = ("alpha_rad", "theta_rad")


class Kinematics(ConfigModel):
    """A Denavit-Hartenberg table, base to flange.

    In the modified convention frame i-1 becomes frame i by Rot_x(alpha) Trans_x(a) Rot_y(beta)
    Rot_z(theta) Trans_z(d), all of row i; in the standard convention by Rot_z(theta) Trans_z(d)
    Trans_x(a) Rot_x(alpha). If an alpha or theta is a multiple of 15 degrees rounded to few
    decimals (1.57), the exact multiple is used.

    Attributes:
        convention: Convention of the table.
        rows: One row per joint.
        calibration: Row by row, the offsets that a kinematic calibration adds to the nominal
            values.
    """

    convention: Literal["modified_dh", "standard_dh"]
    rows: tuple[KinematicRow, ...] = Field(min_length=1)
    calibration: tuple[KinematicRow, ...] = ()

    @model_validator(mode="after")
    def _checks(self) -> Kinematics:
        rows = (*self.rows, *self.calibration)
        if self.convention == "standard_dh" and any(row.beta_rad for row in rows):
            raise ValueError("beta_rad exists in the modified_dh convention only")
        if self.calibration and len(self.calibration) != len(self.rows):
            raise ValueError(
                f"calibration has {len(self.calibration)} rows for {len(self.rows)} rows of the"
                " table; give one per row"
            )
        return self

    @property
    def exact_rows(self) -> tuple[KinematicRow, ...]:
        """The rows with exact angles instead of rounded multiples of 15 degrees."""
        return tuple(
            row.model_copy(
                update={name: AngleReading.of(getattr(row, name)).used_rad for name in _ANGLES}
            )
            for row in self.rows
        )

    @property
    def calibrated_rows(self) -> tuple[KinematicRow, ...]:
        """The exact rows plus the offsets of a kinematic calibration."""
        if not self.calibration:
            return self.exact_rows
        return tuple(
            KinematicRow(
                **{name: getattr(row, name) + getattr(offset, name) for name in _ROW_FIELDS}
            )
            for row, offset in zip(self.exact_rows, self.calibration, strict=True)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes about angles that were read as, or are close to, a multiple of 15 degrees."""
        readings = [
            (f"kinematics.rows.{number}.{name}", AngleReading.of(getattr(row, name)))
            for number, row in enumerate(self.rows)
            for name in _ANGLES
        ]
        return tuple(angle_notes(readings))

    def modified_rows(self) -> tuple[KinematicRow, ...]:
        """Return the rows in the modified convention.

        A standard table is shifted by half a row, so that frame i sits on axis i. The last `a_m`
        and `alpha_rad` (from axis n to the flange) are omitted, because no link's motion depends
        on them.
        """
        rows = self.calibrated_rows
        if self.convention == "modified_dh":
            return rows
        before = (KinematicRow(), *rows[:-1])
        return tuple(
            KinematicRow(
                alpha_rad=previous.alpha_rad,
                a_m=previous.a_m,
                theta_rad=row.theta_rad,
                d_m=row.d_m,
            )
            for previous, row in zip(before, rows, strict=True)
        )
