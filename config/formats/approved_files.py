"""The files that a job was accepted with: what the job reads of them must be the same bytes.

A process has one list, empty unless something was approved. `read_file` asks it, so that no reader
of files can go round it.
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
"""Digits of a SHA-256 that people are shown."""

_approved: dict[str, str] = {}


def approve_files(hashes: Mapping[str, str]) -> None:
    """Approve files for all further reads of this process; others may be read as they are.

    Args:
        hashes: The SHA-256 of each file, by its path.
    """
    _approved.clear()
    _approved.update({os.path.abspath(path): found for path, found in hashes.items()})


def require_approved(path: Path, content: bytes) -> None:
    """Refuse bytes of an approved file that are not those that were approved.

    Raises:
        ConfigError: They differ.
    """
    approved = _approved.get(os.path.abspath(path)) if _approved else None
    if approved is None:
        return
    found = sha256_of(content)
    if found != approved:
        raise ConfigError(
            f"{path}: has changed since the job was accepted (SHA-256 {approved[:SHORT]} then,"
            f" {found[:SHORT]} now): nothing was moved; check the cell if the file is one of its"
            " own, and begin the job again",
            code=CODE,
        )


def sha256_of(content: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()
