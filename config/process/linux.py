"""`has_linux`, `require_linux`: functions that need Linux are refused on other systems.

Cells and the service need locks with a list of their holders, descriptors of processes, sealed
shared memory and SocketCAN, which only Linux has. Imports, identification, design, exports and
timing of paths need none of these.
"""

from __future__ import annotations

import os
import sys

from config.errors import ConfigError


def has_linux() -> bool:
    """Return True on Linux, which is recognised by functions that Python has only there."""
    return hasattr(os, "pidfd_open") and hasattr(os, "memfd_create")


def require_linux(function: str) -> None:
    """Refuse a function that needs Linux on another system.

    Args:
        function: Subject of the message, such as "`rid-daq record`".

    Raises:
        ConfigError: This system is not Linux (RID-SYSTEM-LINUX).
    """
    if not has_linux():
        raise ConfigError(
            f"{function} needs Linux, because it uses a bus, a simulated cell or the service of a"
            f" cell; this system is {sys.platform}. Call it on a Linux computer",
            code="RID-SYSTEM-LINUX",
        )
