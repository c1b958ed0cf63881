"""Buses other than `rid_sim` that simulated devices are served on: whose they are, and where."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

from config.cell import CanBusConfig, CellConfig
from config.errors import TransportError
from mock_hw.runtime_directory import runtime_directory

SIMULATED = "rid_sim"
ONE_PROCESS = "virtual"
_PATIENCE_S = 1.0
_PAUSE_S = 0.02


def served_name(cell: CellConfig) -> str:
    """Return the name of the files beside a served cell: its channel's, or else the cell's own."""
    if cell.can.interface == SIMULATED:
        return cell.can.channel
    return cell.name


def adapter_path(channel: str) -> Path:
    """Return where an slcan adapter is: a path as it is, a plain name in the runtime folder.

    Raises
    ------
    TransportError
        The runtime folder cannot be used.
    """
    name = channel.partition("@")[0]
    return Path(name) if os.sep in name else runtime_directory() / f"{name}.tty"


def as_served(can: CanBusConfig) -> CanBusConfig:
    """Return a bus under the channel that it is served at."""
    if can.interface != "slcan":
        return can
    return can.model_copy(update={"channel": str(adapter_path(can.channel))})


@contextlib.contextmanager
def hold_served_bus(can: CanBusConfig) -> Iterator[None]:
    """Say, for as long as the `with` lasts, that this process serves devices on a bus.

    Raises
    ------
    TransportError
        Another process does.
    """
    descriptor = _open(can)
    try:
        until_s = time.monotonic() + _PATIENCE_S  # somebody may just be looking
        while not _locked(descriptor, fcntl.LOCK_EX):
            if time.monotonic() > until_s:
                raise TransportError(
                    f"CAN bus {can.interface}:{can.channel}: simulated devices are served there"
                    " already; stop those first"
                )
            time.sleep(_PAUSE_S)
        yield
    finally:
        os.close(descriptor)


def is_bus_served(can: CanBusConfig) -> bool:
    """Return whether a process of this user serves simulated devices on a bus."""
    descriptor = _open(can)
    try:
        return not _locked(descriptor, fcntl.LOCK_SH)
    finally:
        os.close(descriptor)


def _open(can: CanBusConfig) -> int:
    bus = f"{can.interface}:{can.channel}"
    words = re.sub(r"[^\w.-]", "_", bus)[-40:]
    digest = hashlib.sha256(bus.encode()).hexdigest()[:8]
    path = runtime_directory() / f"served-{words}-{digest}.lock"
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        raise TransportError(f"{path}: cannot open the lock file ({error})") from None


def _locked(descriptor: int, mode: int) -> bool:
    try:
        fcntl.flock(descriptor, mode | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
