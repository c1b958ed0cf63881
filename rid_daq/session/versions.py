"""Versions of the software that made a result."""

from __future__ import annotations

import platform
from importlib import metadata

_PACKAGES = ("numpy", "scipy", "numba", "pin", "python-can", "mcap")


def program_version() -> str:
    """Return the version of rid-daq."""
    return metadata.version("rid-daq")


def software_versions() -> dict[str, str]:
    """Return the versions of rid-daq, Python and all packages that influence numerical results."""
    versions = {"rid-daq": program_version(), "python": platform.python_version()}
    return versions | {name: metadata.version(name) for name in _PACKAGES}
