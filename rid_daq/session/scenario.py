"""`Scenario`: faults and instruments of simulated devices during one session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.motion.load_changes import LoadChanges
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.simulation.faults import NO_SCRIPT, FaultScript
from config.simulation.plant import PlantConfig
from rid_daq.terminal.choices import NO_PAYLOAD

if TYPE_CHECKING:
    from mock_hw.plant.load_transfer import LoadTransfer


@dataclass(frozen=True)
class Scenario:
    """Faults and instruments of simulated devices during one session.

    Attributes:
        faults: Faults of the devices.
        tracker_file: File for the measurements of the plant's tracker; None for no file.
        load_transfers: Changes of the robot's payload during the motion; a real robot ignores them.
    """

    faults: FaultScript = NO_SCRIPT
    tracker_file: Path | None = None
    load_transfers: tuple[LoadTransfer, ...] = ()

    def refuse_foreign(self, cell: CellConfig) -> None:
        """Refuse a scenario for a cell whose devices this program does not start.

        Raises:
            ConfigError: There are faults, a file for a tracker, or changes of a simulated payload.
        """
        if self.faults is not NO_SCRIPT:
            raise ConfigError(
                f"cell {cell.name}: its devices are real or run in another process, so faults"
                " cannot be simulated in them: leave --faults out, or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        if self.tracker_file is not None:
            raise ConfigError(
                f"cell {cell.name}: its robot is real or runs in another process, so there is no"
                " simulated tracker: leave --tracker out",
                code="RID-CELL-NOT-OURS",
            )

        if self.load_transfers and cell.simulated:
            raise ConfigError(
                f"cell {cell.name}: its robot runs in another process, so its payload cannot change"
                " during a motion: leave `simulated` out of the load-change file",
                code="RID-CELL-NOT-OURS",
            )

    def refuse_unfit(self, plant: PlantConfig) -> None:
        """Refuse a tracker file for a plant without tracker, and unknown payloads.

        Raises:
            ConfigError: The plant has no tracker, or no payload of a name.
        """
        for transfer in self.load_transfers:
            plant.with_payload(transfer.payload)
        if self.tracker_file is not None and plant.tracker is None:
            raise ConfigError(
                f"plant {plant.name!r} has no tracker: add the key `tracker` to the plant file, or"
                " leave --tracker out",
                code="RID-PLANT-UNFIT",
            )


def load_transfers(changes: LoadChanges | None) -> tuple[LoadTransfer, ...]:
    """Return the changes of a simulated robot's payload in a motion with load changes."""
    from mock_hw.plant.load_transfer import GripperSwitch, LoadTransfer

    found = []
    for change in () if changes is None else changes.changes:
        own, signal, switch = change.simulated, change.signal, None
        if own is None:
            continue
        if signal is not None:
            closed = signal.active == "high"
            stuck = own.fault == "stuck"
            switch = GripperSwitch(
                signal.joint, signal.bit, closed, own.signal_delay_s, own.bounce_s, stuck
            )
        name = None if own.payload == NO_PAYLOAD else own.payload
        begin_s, ramp_s = change.at_s + own.late_s, own.ramp_s or change.ramp_s
        missed = own.fault == "never_closes"
        found.append(LoadTransfer(name, begin_s, ramp_s, switch, missed))
    return tuple(found)


def constant_load_notes(changes: LoadChanges | None, cell: CellConfig) -> list[str]:
    """Return a sentence if a simulated robot does not follow some load changes."""
    times = ", ".join(
        f"{change.at_s:g} s"
        for change in (() if changes is None else changes.changes)
        if change.simulated is None
    )
    if not times or not cell.simulated:
        return []
    return [
        f"the payload of the simulated robot does not change at {times}: the load-change file has"
        " no key `simulated` there"
    ]
