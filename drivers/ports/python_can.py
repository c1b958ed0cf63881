"""python-can: its buses opened, with its many kinds of failure as sentences for people.

It is imported without asammdf, whose reader of MDF files costs every process half a second. That
package comes with what is needed to export recordings (the extra `mdf4`), and brings pandas along.
Nothing here reads or writes MDF files through python-can.
"""

from __future__ import annotations

import difflib
import sys
from typing import Any, Final

from config.cell.cell import CanBusConfig
from config.errors import ConfigError, RidDaqError, TransportError

_READER: Final = "asammdf"

if _READER in sys.modules:
    import can
else:
    sys.modules[_READER] = None  # type: ignore[assignment]  # the import then fails, as if absent
    try:
        import can
    finally:
        del sys.modules[_READER]

__all__ = ["can", "not_opened", "open_bus"]


def open_bus(config: CanBusConfig, *, listening: bool = False) -> can.BusABC:
    """Open a bus; one that somebody else drives, to hear every frame on it, `listening`.

    UDP multicast stays on this computer.

    Raises:
        ConfigError: The interface is unknown.
        TransportError: Its driver is missing or the channel cannot be opened.
    """
    options: dict[str, Any] = {"channel": config.channel, "bitrate": config.bitrate}
    try:
        if config.interface == "udp_multicast":
            group, _, port = config.channel.partition("@")
            options = {"channel": group, "hop_limit": 0} | ({"port": int(port)} if port else {})
        elif config.interface == "rid_sim" and not listening:
            options["participant"] = True
        return can.Bus(interface=config.interface, ignore_config=True, **options)
    except Exception as error:  # a driver that is missing makes python-can raise anything
        raise not_opened(config, error) from error


def not_opened(config: CanBusConfig, error: Exception) -> RidDaqError:
    """Return what a person should know who wanted to open a bus."""
    known = sorted(can.VALID_INTERFACES)
    if config.interface not in known:
        close = difflib.get_close_matches(config.interface, known, n=1)
        meant = f"; did you mean {close[0]}?" if close else "."
        return ConfigError(
            f"can.interface: python-can knows no {config.interface!r}{meant} It knows:"
            f" {', '.join(known)}",
            code="RID-CAN-INTERFACE",
        )
    missing = isinstance(error, can.CanInterfaceNotImplementedError | ImportError | NameError)
    if missing or "library not found" in str(error):
        return TransportError(
            f"CAN bus {config.interface}:{config.channel} cannot be opened: the driver library of"
            f" {config.interface!r} is not installed here, or not made for this system ({error});"
            " install its maker's library, or name another can.interface in the cell file",
            code="RID-CAN-LIBRARY",
        )
    return TransportError(
        f"CAN bus {config.interface}:{config.channel} cannot be opened ({error});"
        " check can.interface and can.channel in the cell file, and that the adapter is"
        " plugged in and up",
        code="RID-CAN-OPEN",
    )
