"""Names and locks of buses on which a process runs simulated devices."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

from config.cell.cell import CanBusConfig, CellConfig
from config.errors import TransportError
from config.process.file_locks import file_holder, held_file
from mock_hw.host.runtime_directory import runtime_directory

SIMULATED = "rid_sim"
ONE_PROCESS = "virtual"


def served_name(cell: CellConfig) -> str:
    """Return the name of a simulated cell's files: its channel on `rid_sim`, else its own name."""
    if cell.can.interface == SIMULATED:
        return cell.can.channel
    return cell.name


def adapter_path(channel: str) -> Path:
    """Return the path of the serial port of an slcan channel, without `@` and the text after it.

    A name without a folder is a simulated adapter: NAME.tty in the runtime folder.

    Raises:
        TransportError: The runtime folder cannot be used.
    """
    name = channel.partition("@")[0]
    return Path(name) if os.sep in name else runtime_directory() / f"{name}.tty"


def with_served_channel(can: CanBusConfig) -> CanBusConfig:
    """Return the bus with the channel at which programs open it.

    Raises:
        TransportError: As for `adapter_path`.
    """
    if can.interface != "slcan":
        return can
    return can.model_copy(update={"channel": str(adapter_path(can.channel))})


@contextlib.contextmanager
def hold_served_bus(can: CanBusConfig) -> Iterator[None]:
    """Lock a bus for this process, which runs simulated devices on it.

    Raises:
        TransportError: Another process runs simulated devices on the bus.
    """
    with contextlib.ExitStack() as stack:
        path = _lock_path(can)
        try:
            stack.enter_context(held_file(path))
        except BlockingIOError:
            raise TransportError(
                f"CAN bus {can.interface}:{can.channel}: another process already serves simulated"
                " devices on this bus; stop it first",
                code="RID-MOCK-SERVED",
            ) from None
        except OSError as error:
            raise TransportError(
                f"{path}: cannot open the lock file ({error})", code="RID-FILE-ACCESS"
            ) from None
        yield


def is_bus_served(can: CanBusConfig) -> bool:
    """Return True if a process of this user runs simulated devices on a bus."""
    return file_holder(_lock_path(can)) is not None


def _lock_path(can: CanBusConfig) -> Path:
    bus = f"{can.interface}:{can.channel}"
    words = re.sub(r"[^\w.-]", "_", bus)[-40:]
    digest = hashlib.sha256(bus.encode()).hexdigest()[:8]
    return runtime_directory() / f"served-{words}-{digest}.lock"
