"""Removal of all compiled kernels after a change of any kernel.

numba stores compiled code next to the source file and reuses it while this file is unchanged.
Called kernels are compiled into the caller. After a pull that changes only the called kernel, the
caller would still contain the old one.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

PACKAGES = ("dynamics", "compensation", "mock_hw")
_COMPILES = re.compile(rb"^@(kernel|njit)\b", re.MULTILINE)


def forget_stale_kernels(root: Path) -> bool:
    """Delete all compiled kernels if the source of any kernel has changed since the last call.

    The first call deletes them too.

    Args:
        root: Folder of the packages; ``build/kernels`` below it stores the digest of the sources.

    Returns:
        True if the compiled kernels were deleted.
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
