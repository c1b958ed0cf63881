"""Versions of the software that made a result."""

from __future__ import annotations

import functools
import json
import platform
import subprocess
from importlib import metadata
from pathlib import Path

GIT_S = 10.0
"""Timeout of the question to git [s]."""

_PACKAGES = ("numpy", "scipy", "numba", "pin", "python-can", "mcap")


def program_version() -> str:
    """Return the version of rid-daq."""
    return metadata.version("rid-daq")


def software_versions() -> dict[str, str]:
    """Return the versions of rid-daq, Python and the packages that influence results most."""
    versions = {"rid-daq": program_version(), "python": platform.python_version()}
    if commit := program_commit():
        versions["commit"] = commit
    return versions | {name: metadata.version(name) for name in _PACKAGES}


@functools.cache
def program_commit() -> str:
    """Return the commit of this program, with `-changed` if files differ; empty if unknown.

    It is known in a clone with git, and for an installation from a git repository.
    """
    clone = Path(__file__).parents[2]
    if (clone / ".git").exists():
        words = ["git", "-C", str(clone), "describe", "--always", "--abbrev=12", "--exclude=*"]
        try:
            done = subprocess.run(
                [*words, "--dirty=-changed"],
                capture_output=True,
                text=True,
                check=True,
                timeout=GIT_S,
            )
        except (OSError, subprocess.SubprocessError):  # no git, or the clone is not readable for it
            return ""
        return done.stdout.strip()
    origin = metadata.distribution("rid-daq").read_text("direct_url.json")
    info = json.loads(origin).get("vcs_info", {}) if origin else {}
    return str(info.get("commit_id", ""))[:12]
