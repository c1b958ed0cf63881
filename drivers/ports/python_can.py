"""Opening of CAN buses by python-can, with a readable message for each kind of failure.

python-can imports asammdf, which reads MDF files, if that package is installed (rid-daq installs it
with the extra `mdf4`, to export recordings). asammdf imports pandas, which would delay the start of
every process by half a second. MDF files are not read or written by python-can here, so asammdf is
hidden while python-can is imported.
"""

from __future__ import annotations

import difflib
import sys
import time
from typing import Any, Final

from config.cell.cell import CanBusConfig
from config.errors import ConfigError, RidDaqError, TransportError

_READER: Final = "asammdf"

_SLCAN_QUIET_S = 0.02
_SLCAN_SILENCE_TIMEOUT_S = 1.0
_SLCAN_READ_BYTES = 1 << 16

if _READER in sys.modules:
    import can
else:
    sys.modules[_READER] = None  # type: ignore[assignment]  # its import now fails
    try:
        import can
    finally:
        del sys.modules[_READER]

__all__ = ["can", "not_opened", "open_bus"]


def open_bus(config: CanBusConfig, *, listening: bool = False) -> can.BusABC:
    """Open a bus; with `listening`, only to observe the frames on another program's bus.

    Frames of UDP multicast do not leave this computer.

    Raises:
        ConfigError: The interface is unknown.
        TransportError: The interface's driver is missing, or the channel cannot be opened.
    """
    options: dict[str, Any] = {"channel": config.channel, "bitrate": config.bitrate}
    try:
        if config.interface == "udp_multicast":
            group, _, port = config.channel.partition("@")
            options = {"channel": group, "hop_limit": 0} | ({"port": int(port)} if port else {})
        elif config.interface == "socketcand":
            options = _socketcand_options(config)
        elif config.is_simulated and not listening:
            options["participant"] = True
        bus = can.Bus(interface=config.interface, ignore_config=True, **options)
        if config.interface == "slcan":
            try:
                _discard_torn_lines(bus)
            except BaseException:
                bus.shutdown()
                raise
        return bus
    except ConfigError:
        raise
    except Exception as error:  # python-can raises any error if a driver is missing
        raise not_opened(config, error) from error


def _socketcand_options(config: CanBusConfig) -> dict[str, Any]:
    """Return the interface, the computer and the port in a channel such as can0@10.0.0.7:29536."""
    channel, _, host = config.channel.partition("@")
    name, _, port = host.rpartition(":")
    if not (channel and name and port.isdigit()):
        raise ConfigError(
            f"can.channel {config.channel!r}: socketcand is on another computer: write interface,"
            " address and port, such as can0@192.168.1.5:29536",
            code="RID-CAN-INTERFACE",
        )
    return {"channel": channel, "host": name, "port": int(port)}


def _discard_torn_lines(bus: can.BusABC) -> None:
    """Close an slcan channel, discard the bytes that still arrive, and open the channel again.

    If another program ended without closing the channel, these bytes begin or end inside a line,
    and python-can would take the incomplete line for a frame. The commands are C and O of LAWICEL's
    CANUSB manual.
    """
    from can.interfaces.slcan import slcanBus

    assert isinstance(bus, slcanBus)
    port = bus.serialPortOrig
    bus.close()
    line_timeout_s, port.timeout = port.timeout, _SLCAN_QUIET_S
    until_s = time.monotonic() + _SLCAN_SILENCE_TIMEOUT_S
    is_silent = False
    while not is_silent and time.monotonic() < until_s:
        is_silent = not port.read(_SLCAN_READ_BYTES)
    port.timeout = line_timeout_s
    bus.flush()
    bus.open()


def not_opened(config: CanBusConfig, error: Exception) -> RidDaqError:
    """Return the error for a bus that cannot be opened."""
    known = sorted(can.VALID_INTERFACES)
    if config.interface not in known:
        close = difflib.get_close_matches(config.interface, known, n=1)
        meant = f"; did you mean {close[0]}?" if close else "."
        return ConfigError(
            f"can.interface: python-can does not support {config.interface!r}{meant} Supported:"
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
