"""`PlateCheck`: lines of the preflight on the force plate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.session.plate_preparation import (
    ZERO_LIMIT_N,
    PlateReadiness,
    prepare_plate,
    read_zero_drift_n,
)
from config.cell.amplifier_profile import LINE_LOAD_LIMIT, AmplifierProfile, line_load
from config.cell.cell import CellConfig
from config.cell.plate import CHANNEL_NAMES, PlateConfig, PlateZero
from rid_daq.preflight.check_line import CheckLine

POSE_RAD = 0.02
PLATE = "force plate"

_ZERO = "measure the offsets with `rid-daq plate zero`"


class PlateCheck:
    """Checks a cell's force plate: one step before the check of the drives, one step after it.

    Args:
        cell: The cell with ports that this program can open.
        profile: Protocol of its amplifier; None without a plate.

    Attributes:
        lines: Lines of the preflight so far.
    """

    def __init__(self, cell: CellConfig, profile: AmplifierProfile | None) -> None:
        self._cell = cell
        self._profile = profile
        self._ready: PlateReadiness | None = None
        self.lines: list[CheckLine] = []

    def before(self) -> list[CheckLine]:
        """Identify the amplifier, write its settings, read them back, and check for overloads.

        The forces are not zeroed. A simulated amplifier of this session is switched to operate,
        because no other program can do that.

        Raises:
            DriverError: The amplifier cannot be reached, or does not accept a setting.
        """
        plate, profile = self._cell.plate, self._profile
        if plate is None or profile is None:
            return []
        load = line_load(plate.amplifier, profile, self._cell.cycle_time_s)
        self._add_check(
            "line load",
            f"≤ {100.0 * LINE_LOAD_LIMIT:.0f} %",
            f"{100.0 * load:.1f} %",
            load <= LINE_LOAD_LIMIT,
            "lower rate_hz, or raise baud_rate",
        )
        ready = prepare_plate(plate, profile, operate=self._cell.simulated)
        self._ready = ready
        self.lines.append(CheckLine(PLATE, "amplifier", "", ready.identity, "shown"))
        wrong = [s for s in ready.settings if s.verdict == "red"]
        self._add_check(
            "settings read back",
            f"{len(ready.settings)} as in the cell file",
            "; ".join(f"{s.name} is {s.found}" for s in wrong) or f"{len(ready.settings)}",
            not wrong,
            "choose values that the amplifier supports",
        )
        self._add_check(
            "channels measure",
            "operate",
            _amplifier_state(ready),
            ready.operating and not ready.charge_lost,
            _ZERO,
        )
        over = [name for name, flag in zip(CHANNEL_NAMES, ready.overloads, strict=True) if flag]
        self._add_check(
            "overloads",
            "none",
            ", ".join(over) or "none",
            not over,
            "choose a larger range_n for these channels, then check again; the overload flags"
            " are now reset",
        )
        return list(self.lines)

    def after(self, position: Sequence[float] | None = None) -> list[CheckLine]:
        """Check the forces at rest, if the channels measure.

        Args:
            position: Present positions of the joints [rad or m]; None if unknown.

        Raises:
            DriverError: The amplifier does not answer.
        """
        plate, profile, ready = self._cell.plate, self._profile, self._ready
        if plate is None or profile is None or ready is None or not ready.operating:
            return []
        first = len(self.lines)
        self._check_zero(plate, profile, position)
        return self.lines[first:]

    def _check_zero(
        self, plate: PlateConfig, profile: AmplifierProfile, position: Sequence[float] | None
    ) -> None:
        zero_n = read_zero_drift_n(plate, profile)
        worst = int(np.argmax(np.abs(zero_n)))
        found = f"{CHANNEL_NAMES[worst]} {zero_n[worst]:.2f} N"
        what, required = "deviation of the force at rest from its zero", f"≤ {ZERO_LIMIT_N:g} N"
        good = bool(abs(zero_n[worst]) <= ZERO_LIMIT_N)
        if plate.zero is None:
            what = "force at rest"
            if self._cell.simulated:
                self._add_information(f"{what}, plate never zeroed", found)
                return
        elif not _is_in_zero_pose(plate.zero, position):
            self._add_information(f"{what}, in another pose than at zeroing", found)
            return
        self._add_check(
            what,
            required,
            found,
            good,
            f"if the robot is in the pose of the last zeroing, {_ZERO} again",
        )

    def _add_information(self, what: str, found: str) -> None:
        self.lines.append(CheckLine(PLATE, what, "", found, "shown"))

    def _add_check(self, what: str, required: str, found: str, good: bool, action: str) -> None:
        self.lines.append(
            CheckLine(
                where=PLATE,
                what=what,
                required=required,
                found=found,
                verdict="ok" if good else "red",
                next_action="" if good else action,
            )
        )


def _amplifier_state(ready: PlateReadiness) -> str:
    if not ready.operating:
        return "reset"
    return "operate, but the settings have reset the charge" if ready.charge_lost else "operate"


def _is_in_zero_pose(zero: PlateZero, position: Sequence[float] | None) -> bool:
    """Return False if the robot is known to be in another pose than at the zeroing of the plate."""
    if not zero.pose or position is None or len(position) != len(zero.pose):
        return True
    return bool(np.allclose(position, zero.pose, rtol=0.0, atol=POSE_RAD))
