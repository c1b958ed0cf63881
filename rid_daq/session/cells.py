"""The cell that a command works on: held alone, its mock hardware started where it is needed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from config.cell.cell import CellConfig
from config.errors import ConfigError, TransportError
from config.load import LoadedCell
from config.simulation.faults import NO_SCRIPT, FaultScript
from rid_daq.preflight.eds_check import refuse_unfit_eds
from rid_daq.requests.cell_options import Simulation
from rid_daq.session.ownership import refuse_owned
from rid_daq.session.session import hold_cell

if TYPE_CHECKING:
    from mock_hw.cell import SimulatedCell


@contextlib.contextmanager
def mountable_cell(
    loaded: LoadedCell,
    simulation: Simulation | None = None,
    faults: FaultScript = NO_SCRIPT,
    *,
    any_eds: bool = False,
) -> Iterator[tuple[CellConfig, SimulatedCell | None]]:
    """Yield the cell with devices behind its bus, held alone as long as the `with` lasts.

    A real cell, and a simulated one that `rid-daq mock` serves, are taken as they are. Otherwise
    a simulated cell's mock hardware is started on a bus of this session's own, and yielded too:
    payloads can be mounted on it while it runs.

    Args:
        loaded: The cell file and what it names.
        simulation: How mock hardware that is started here is.
        faults: What goes wrong in it.
        any_eds: Whether the caller itself says what the drives' data sheets lack.

    Raises:
        ConfigError: There is no such payload, or no mock hardware started here that it could be
            mounted on, or that could have faults; or it has two ways to keep time.
        PreflightError: By its data sheet a drive cannot do what it is needed for.
        LockedError: Another session holds the cell.
        TransportError: The mock hardware does not start.
    """
    simulation = simulation or Simulation()
    payload, cell = simulation.payload, loaded.config
    if simulation.realtime and simulation.pace is not None:
        raise ConfigError(
            "--realtime and --pace are two ways to keep time: give one", code="RID-OPTION-EXCLUSIVE"
        )
    refuse_one_process(cell)
    refuse_owned(cell)
    if not any_eds:
        refuse_unfit_eds(loaded)
    if not cell.simulated or is_served(cell):
        if simulation.pace is not None:
            raise ConfigError(
                f"cell {cell.name}: its devices are not started here and keep their own time: leave"
                " --pace out, or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        if payload is not None:
            raise ConfigError(
                f"cell {cell.name}: its robot is not started here, so nothing can be mounted on its"
                " flange: leave --payload out, or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        if faults is not NO_SCRIPT:
            raise ConfigError(
                f"cell {cell.name}: its devices are not started here, so nothing can be made to go"
                " wrong in them: leave --faults out, or give it to `rid-daq mock`",
                code="RID-CELL-NOT-OURS",
            )
        with hold_cell(cell):
            yield _as_served(cell), None
        return
    from mock_hw.bus.served_bus import SIMULATED
    from mock_hw.cell import SimulatedCell
    from mock_hw.simulation import CellSimulation

    if loaded.plant is None:
        raise ConfigError(
            f"cell {cell.name}: a simulated cell needs plant", code="RID-CELL-NOT-SIMULATED"
        )
    if simulation.pace is not None and cell.can.interface != SIMULATED:
        raise ConfigError(
            f"cell {cell.name}: time waits for nobody on {cell.can.interface}: leave --pace out",
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
                faults=faults,
                pace=simulation.pace,
            )
        ) as simulated,
        hold_cell(simulated.cell),
    ):
        yield simulated.cell, simulated


def _as_served(cell: CellConfig) -> CellConfig:
    """Return the cell with bus and serial ports as `rid-daq mock` has made them."""
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
    """Refuse a bus that does not leave a process: sessions are several.

    Raises:
        ConfigError: The cell's interface is `virtual`.
    """
    if cell.can.interface == "virtual":
        raise ConfigError(
            f"cell {cell.name}: can.interface virtual lives within one process, a session has"
            " several; use rid_sim, udp_multicast, slcan or socketcan",
            code="RID-CAN-INTERFACE",
        )


def is_served(cell: CellConfig) -> bool:
    """Return whether somebody serves the cell's simulated devices already."""
    if cell.can.interface != "rid_sim":
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
