"""Hashes of the files that a job was accepted with, to detect files that changed since.

A process has one list, empty unless files were approved. `read_file` and `read_pieces` check it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from config.errors import ConfigError

CODE: Final = "RID-JOB-FILES"
SHORT: Final = 12
"""Number of SHA-256 digits shown to people."""

_approved: dict[str, str] = {}


def approve_files(hashes: Mapping[str, str]) -> None:
    """Set the list of approved files, which this process reads only if they are unchanged.

    The earlier list is replaced. Files that are not listed are not checked.

    Args:
        hashes: The SHA-256 of each file, by its path.
    """
    _approved.clear()
    _approved.update({os.path.abspath(path): found for path, found in hashes.items()})


def require_approved(path: Path, content: bytes) -> None:
    """Refuse an approved file whose bytes differ from the approved ones.

    Raises:
        ConfigError: The bytes differ.
    """
    if os.path.abspath(path) in _approved:
        require_approved_hash(path, sha256_of(content))


def require_approved_hash(path: Path, found: str) -> None:
    """Refuse a file by the SHA-256 that was found; raises as `require_approved`."""
    approved = _approved.get(os.path.abspath(path))
    if approved is not None and found != approved:
        raise ConfigError(
            f"{path}: has changed since the job was accepted (SHA-256 {approved[:SHORT]} then,"
            f" {found[:SHORT]} now); nothing was moved. Check the cell if this is one of its"
            " files, and start the job again",
            code=CODE,
        )


def sha256_of(content: bytes) -> str:
    """Return the SHA-256 of bytes as hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()
