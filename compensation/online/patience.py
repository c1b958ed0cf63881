"""How long a stream of set-points waits: the command line's help says so without numerics."""

from __future__ import annotations

from typing import Final

BUFFER_S: Final = 1.0


CLIENT_PATIENCE_S: Final = 60.0
