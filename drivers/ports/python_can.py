"""python-can, imported without asammdf: its reader of MDF files costs every process half a second.

That package comes with what is needed to export recordings (the extra `mdf4`), and brings pandas
along. Nothing here reads or writes MDF files through python-can.
"""

from __future__ import annotations

import sys
from typing import Final

_READER: Final = "asammdf"

if _READER in sys.modules:
    import can
else:
    sys.modules[_READER] = None  # type: ignore[assignment]  # the import then fails, as if absent
    try:
        import can
    finally:
        del sys.modules[_READER]

__all__ = ["can"]
