"""Choices and defaults of command-line options.

The help of a command imports this module, so nothing here imports numerics. The modules that use a
choice document its meaning.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Final

MODEL: Final = "model.json"
PAYLOAD: Final = "payload.json"
CERTIFICATE: Final = "certificate.pdf"
"""Files that `identify`, `payload identify` and `payload certificate` write into a run folder."""

NO_PAYLOAD: Final = "none"
PAYLOAD_OF_MODEL: Final = "model"
"""Values of `--payload` that are not files or runs."""

DEFAULT_RUNS: Final = Path("runs")
"""Default folder of the run folders."""

DEFAULT_LISTEN: Final = "127.0.0.1:8642"
"""Default address and port of the pages."""

JOG_PERCENT: Final = 5.0
"""Default speed of `jog` in percent of the speed limit."""

DEMO_PERIOD_S: Final = 10.0
"""Period of the excitation trajectories of `demo` [s]."""


class Kind(StrEnum):
    """Kind of motion that `design` makes."""

    EXCITATION = "excitation"
    CONSTANT_VELOCITY = "constant-velocity"
    REVERSED = "reversed"
    MULTISINE = "multisine"


class Format(StrEnum):
    """File formats for export."""

    URDF = "urdf"
    SDF = "sdf"
    MJCF = "mjcf"
    PINOCCHIO = "pinocchio"
    KDL = "kdl"
    C = "c"
    PYTHON = "python"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"
    MAT = "mat"
    MDF4 = "mdf4"
