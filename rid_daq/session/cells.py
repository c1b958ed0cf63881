"""Opens the cell that a command works on, and starts its simulated devices if necessary."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from config.cell.cell import CellConfig
from config.errors import ConfigError, TransportError
from config.load import LoadedCell
from rid_daq.preflight.eds_check import refuse_unfit_eds
from rid_daq.requests.cell_options import Simulation
from rid_daq.session.ownership import refuse_owned
from rid_daq.session.scenario import Scenario
from rid_daq.session.session import hold_cell

if TYPE_CHECKING:
    from mock_hw.cell import SimulatedCell


@contextlib.contextmanager
def hold_reachable_cell(
    loaded: LoadedCell,
    simulation: Simulation | None = None,
    scenario: Scenario | None = None,
    *,
    any_eds: bool = False,
) -> Iterator[tuple[CellConfig, SimulatedCell | None]]:
    """Yield the cell with devices on its bus; no other session can use it inside the `with` block.

    The devices of a real cell, and of a simulated cell that `rid-daq mock` serves, run already. For
    any other simulated cell, this function starts simulated devices on a bus of this session and
    yields them too: payloads can be mounted on their robot.

    Args:
        loaded: The cell file and the files that it names.
        simulation: Settings of the simulated devices that are started here.
        scenario: Faults and instruments of these devices.
        any_eds: True if the caller itself reports problems of the drives' EDS files.

    Raises:
        ConfigError: A setting contradicts another one, or needs simulated devices that are started
            here; or the payload does not exist.
        PreflightError: According to its EDS file, a drive lacks a required object.
        LockedError: Another session holds the cell.
        TransportError, RecordingError: The simulated devices do not start, or a lock cannot be
            used.
    """
    simulation, scenario = simulation or Simulation(), scenario or Scenario()
    payload, cell = simulation.payload, loaded.config
    if simulation.realtime and simulation.pace is not None:
        raise ConfigError(
            "--realtime and --pace exclude each other: give one option only",
            code="RID-OPTION-EXCLUSIVE",
        )
    refuse_one_process(cell)
    refuse_owned(cell)
    if not any_eds:
        refuse_unfit_eds(loaded)
    if not cell.simulated or is_served(cell):
        if simulation.pace is not None:
            raise ConfigError(
                f"cell {cell.name}: its devices are real or run in another process, which"
                " sets the pace: leave --pace out, or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        if payload is not None:
            raise ConfigError(
                f"cell {cell.name}: its robot is real or runs in another process, so no payload"
                " can be mounted on its flange: leave the payload out (--mounted, or --payload"
                " without --model), or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        scenario.refuse_foreign(cell)
        with hold_cell(cell):
            yield _with_served_addresses(cell), None
        return
    from mock_hw.bus.served_bus import SIMULATED
    from mock_hw.cell import SimulatedCell
    from mock_hw.simulation import CellSimulation

    if loaded.plant is None:
        raise ConfigError(
            f"cell {cell.name}: a simulated cell needs the key plant", code="RID-CELL-NOT-SIMULATED"
        )
    scenario.refuse_unfit(loaded.plant)
    if simulation.pace is not None and cell.can.interface != SIMULATED:
        raise ConfigError(
            f"cell {cell.name}: {cell.can.interface} runs in real time only: leave --pace out",
            code="RID-MOCK-REAL-TIME",
        )
    with (
        SimulatedCell(
            CellSimulation(
                cell,
                loaded.robot,
                loaded.plant if payload is None else loaded.plant.with_payload(payload),
                realtime=simulation.realtime or cell.can.interface != SIMULATED,
                seed=simulation.seed,
                amplifier_profile=loaded.amplifier_profile,
                drive_profile=loaded.drive_profile,
                faults=scenario.faults,
                pace=simulation.pace,
                tracker_file=scenario.tracker_file,
                load_transfers=scenario.load_transfers,
            )
        ) as simulated,
        hold_cell(simulated.cell),
    ):
        yield simulated.cell, simulated


def _with_served_addresses(cell: CellConfig) -> CellConfig:
    """Return the cell with the bus and the serial ports that `rid-daq mock` has created."""
    if not cell.simulated:
        return cell
    from mock_hw.bus.served_bus import served_name, with_served_channel
    from mock_hw.host.runtime_directory import plate_path, registers_path
    from mock_hw.simulation import on_pseudo_terminal, with_address

    served = cell.model_copy(update={"can": with_served_channel(cell.can)})
    line = registers_path(served_name(cell))
    if cell.monitor is not None and cell.monitor.link.kind == "rtu" and line.exists():
        link = on_pseudo_terminal(cell.monitor.link, line)
        monitor = cell.monitor.model_copy(update={"link": link})
        served = served.model_copy(update={"monitor": monitor})
    port = plate_path(served_name(cell))
    return with_address(served, str(port)) if cell.plate and port.exists() else served


def refuse_one_process(cell: CellConfig) -> None:
    """Raise an error for a bus within one process, because a session has several processes.

    Raises:
        ConfigError: The cell's interface is `virtual`.
    """
    if cell.can.interface == "virtual":
        raise ConfigError(
            f"cell {cell.name}: can.interface virtual exists only within one process, but a"
            " session has several processes; use rid_sim, udp_multicast, slcan or socketcan",
            code="RID-CAN-INTERFACE",
        )


def is_served(cell: CellConfig) -> bool:
    """Return True if another process already serves the cell's simulated devices."""
    if not cell.can.is_simulated:
        from mock_hw.bus.served_bus import is_bus_served, with_served_channel

        return is_bus_served(with_served_channel(cell.can))
    from mock_hw.bus.hub_client import HubClient
    from mock_hw.bus.hub_protocol import HubRole
    from mock_hw.host.runtime_directory import socket_path

    path = socket_path(cell.can.channel)
    if not path.exists():
        return False
    try:
        HubClient(path, HubRole.OBSERVER, timeout_s=2.0).close()
    except TransportError:
        return False
    return True
