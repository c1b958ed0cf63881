"""Which software made a result."""

from __future__ import annotations

import platform
from importlib import metadata

_PACKAGES = ("numpy", "scipy", "numba", "pin", "python-can", "mcap")


def program_version() -> str:
    """Return rid-daq's own version."""
    return metadata.version("rid-daq")


def software_versions() -> dict[str, str]:
    """Return name and version of everything that shapes a number: program, Python, packages."""
    versions = {"rid-daq": program_version(), "python": platform.python_version()}
    return versions | {name: metadata.version(name) for name in _PACKAGES}
