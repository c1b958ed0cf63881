"""Compiled kernels on disk that are older than one of the kernels they call.

numba keeps what it compiled beside the source and takes it up again while that one file is
unchanged. What a kernel calls is compiled into it, wherever it stands: after a pull that changes
only the callee, the caller would go on with the old one.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

PACKAGES = ("dynamics", "compensation", "mock_hw")
_COMPILES = re.compile(rb"^@(kernel|njit)\b", re.MULTILINE)


def forget_stale_kernels(root: Path) -> bool:
    """Delete everything compiled where any kernel's source has changed since the last time.

    Args:
        root: Where the packages lie; ``build/kernels`` below it keeps the digest of the sources.

    Returns:
        Whether they had changed.
    """
    files = sorted(file for package in PACKAGES for file in (root / package).rglob("*.py"))
    digest = hashlib.sha256()
    for source in map(Path.read_bytes, files):
        if _COMPILES.search(source):
            digest.update(source)
    kept = root / "build" / "kernels"
    if kept.is_file() and kept.read_text(encoding="ascii") == digest.hexdigest():
        return False
    for package in PACKAGES:
        for compiled in (root / package).rglob("__pycache__/*.nb[ic]"):
            compiled.unlink(missing_ok=True)
    kept.parent.mkdir(exist_ok=True)
    kept.write_text(digest.hexdigest(), encoding="ascii")
    return True
