"""`DrivesSettings`: settings of the process of the simulated drives.

The program creates these settings without importing the modules of that process, because it does
not need their libraries.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from config.cell.cell import CanBusConfig
from mock_hw.amplifier.settings import PlateSettings
from mock_hw.host.runtime_directory import axes_path
from mock_hw.registers.server import RegisterSettings
from mock_hw.simulation import CellSimulation


@dataclass(frozen=True)
class DrivesSettings:
    """Settings of the drives' process.

    Attributes:
        simulation: The simulated cell and its settings.
        socket: Path of the hub's socket. The names of all other files of the cell begin with its
            name.
        plate: Settings of the plate's amplifier.
        registers: Settings of the drives' registers.
        bus: Bus that the drives join; None for the hub of `rid_sim`.
    """

    simulation: CellSimulation
    socket: Path
    plate: PlateSettings | None = None
    registers: RegisterSettings | None = None
    bus: CanBusConfig | None = None

    @property
    def has_hub_process(self) -> bool:
        """True if the hub has its own process, as in real time."""
        return self.bus is None and self.simulation.realtime

    @property
    def hosts_masters(self) -> bool:
        """True if the process can run masters of the hub.

        A fault script that disturbs the program's processes needs a process for each master.
        """
        simulation = self.simulation
        return self.bus is None and not (simulation.realtime or simulation.faults.program)

    @property
    def snapshot(self) -> Path:
        """Path of the file with the true state of the axes."""
        return axes_path(str(self.socket))
