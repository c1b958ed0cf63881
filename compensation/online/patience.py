"""Waiting times of a stream of set-points, without numerics for the help of the command line."""

from __future__ import annotations

from typing import Final

BUFFER_S: Final = 1.0


CLIENT_PATIENCE_S: Final = 60.0
