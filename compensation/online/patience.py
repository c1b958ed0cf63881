"""Default times of a stream of points; no slow imports, because option help imports this module."""

from __future__ import annotations

from typing import Final

BUFFER_S: Final = 1.0


CLIENT_PATIENCE_S: Final = 60.0
