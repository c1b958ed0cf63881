"""What options choose among, and what holds where they are not given.

A command's help is shown from these alone, so nothing here imports numerics; what the choices mean
stands where they are used.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Final

MODEL: Final = "model.json"
PAYLOAD: Final = "payload.json"
CERTIFICATE: Final = "certificate.pdf"
"""The files of a run that `identify`, `payload identify` and `payload certificate` write."""

DEFAULT_RUNS: Final = Path("runs")
"""The folder of the run folders."""

DEFAULT_LISTEN: Final = "127.0.0.1:8642"
"""Where pages are served."""

JOG_PERCENT: Final = 5.0
"""Of the speed limit: how fast `jog` moves."""

DEMO_PERIOD_S: Final = 10.0
"""The period of the excitations of `demo`."""


class Kind(StrEnum):
    """What the motion is for."""

    EXCITATION = "excitation"
    CONSTANT_VELOCITY = "constant-velocity"
    REVERSED = "reversed"
    MULTISINE = "multisine"


class Format(StrEnum):
    """What can be written."""

    URDF = "urdf"
    SDF = "sdf"
    PINOCCHIO = "pinocchio"
    C = "c"
    PYTHON = "python"
    CSV = "csv"
    JSON = "json"
    PARQUET = "parquet"
    MAT = "mat"
    MDF4 = "mdf4"
