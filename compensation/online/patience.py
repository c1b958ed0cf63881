"""Waiting times of a stream of set-points; without slow imports, because the help uses it."""

from __future__ import annotations

from typing import Final

BUFFER_S: Final = 1.0


CLIENT_PATIENCE_S: Final = 60.0
