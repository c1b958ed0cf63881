"""`PlateCheck`: the force plate's lines of the preflight."""

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
from rid_daq.preflight.bus_check import CheckLine

POSE_RAD = 0.02

_ZERO = "let `rid-daq plate zero` find the plate's zero"


class PlateCheck:
    """Checks a cell's plate, in two steps around the check of the drives.

    Args:
        cell: The cell, reachable.
        profile: What its amplifier speaks; None without a plate.

    Attributes:
        lines: What was found so far.
    """

    def __init__(self, cell: CellConfig, profile: AmplifierProfile | None) -> None:
        self._cell = cell
        self._profile = profile
        self._ready: PlateReadiness | None = None
        self.lines: list[CheckLine] = []

    def before(self) -> list[CheckLine]:
        """Identify, set and read back, look at overloads; nothing is zeroed.

        Mock hardware of the session's own is put into operation, as nobody else can have done it.

        Raises:
            DriverError: The amplifier cannot be reached, or does not take a setting.
        """
        plate, profile = self._cell.plate, self._profile
        if plate is None or profile is None:
            return []
        load = line_load(plate.amplifier, profile, self._cell.cycle_time_s)
        self._add(
            "line load",
            f"≤ {100.0 * LINE_LOAD_LIMIT:.0f} %",
            f"{100.0 * load:.1f} %",
            load <= LINE_LOAD_LIMIT,
            "lower rate_hz, or raise baud_rate",
        )
        ready = prepare_plate(plate, profile, operate=self._cell.simulated)
        self._ready = ready
        self.lines.append(
            CheckLine(plate.amplifier.address, "who answers", "", ready.identity, "shown")
        )
        wrong = [s for s in ready.settings if s.verdict == "red"]
        self._add(
            "settings read back",
            f"{len(ready.settings)} as in the cell file",
            "; ".join(f"{s.name} is {s.found}" for s in wrong) or f"{len(ready.settings)}",
            not wrong,
            "choose values that the amplifier has",
        )
        self._add(
            "channels measure",
            "operate",
            _state(ready),
            ready.operating and not ready.charge_lost,
            _ZERO,
        )
        over = [name for name, flag in zip(CHANNEL_NAMES, ready.overloads, strict=True) if flag]
        self._add(
            "overloads",
            "none",
            ", ".join(over) or "none",
            not over,
            "choose a larger range_n for these channels, then check again: it is forgotten now",
        )
        return list(self.lines)

    def after(self, position: Sequence[float] | None = None) -> list[CheckLine]:
        """Look at the forces at rest, where the channels measure.

        Args:
            position: Where the robot stands [rad or m]; None where that is not known.

        Raises:
            DriverError: The amplifier does not answer.
        """
        plate, profile, ready = self._cell.plate, self._profile, self._ready
        if plate is None or profile is None or ready is None or not ready.operating:
            return []
        first = len(self.lines)
        self._zero(plate, profile, position)
        return self.lines[first:]

    def _zero(
        self, plate: PlateConfig, profile: AmplifierProfile, position: Sequence[float] | None
    ) -> None:
        zero_n = read_zero_drift_n(plate, profile)
        worst = int(np.argmax(np.abs(zero_n)))
        found = f"{CHANNEL_NAMES[worst]} {zero_n[worst]:.2f} N"
        what, required = "force at rest beyond its zero", f"≤ {ZERO_LIMIT_N:g} N"
        good = bool(abs(zero_n[worst]) <= ZERO_LIMIT_N)
        if plate.zero is None:
            what = "force at rest"
            if self._cell.simulated:
                self._show(f"{what}, never zeroed", found)
                return
        elif not _stands_there(plate.zero, position):
            self._show(f"{what}, elsewhere than there", found)
            return
        self._add(what, required, found, good, f"is the robot where it was? If so, {_ZERO} again")

    def _show(self, what: str, found: str) -> None:
        plate = self._cell.plate
        where = "force plate" if plate is None else plate.amplifier.address
        self.lines.append(CheckLine(where, what, "", found, "shown"))

    def _add(self, what: str, required: str, found: str, good: bool, action: str) -> None:
        plate = self._cell.plate
        self.lines.append(
            CheckLine(
                where="force plate" if plate is None else plate.amplifier.address,
                what=what,
                required=required,
                found=found,
                verdict="ok" if good else "red",
                next_action="" if good else action,
            )
        )


def _state(ready: PlateReadiness) -> str:
    if not ready.operating:
        return "reset"
    return "operate, charge lost by setting" if ready.charge_lost else "operate"


def _stands_there(zero: PlateZero, position: Sequence[float] | None) -> bool:
    """Return whether the robot stands where the plate was zeroed, as far as that is known."""
    if not zero.pose or position is None or len(position) != len(zero.pose):
        return True
    return bool(np.allclose(position, zero.pose, rtol=0.0, atol=POSE_RAD))
