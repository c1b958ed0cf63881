"""`PlateHeader`: what a force plate's journal says about itself."""

from __future__ import annotations

from acquisition.journal.header import HeaderModel
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import PlateConfig


class PlateHeader(HeaderModel):
    """Everything needed to read the rows, even without the run folder.

    `identity` is what the amplifier said about itself, escaped. `simulated_time` is true where
    arrivals are a simulated cell's time and not the computer's.
    """

    plate: PlateConfig
    profile: AmplifierProfile
    identity: str = ""
    simulated_time: bool = False
    cell_name: str = ""
    run_id: str = ""
