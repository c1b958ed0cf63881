"""The kernels of the on-line compensation are compiled before the cyclic task begins."""

from __future__ import annotations

import json
import subprocess
import sys

PROGRAM = """
import json
import pickle

from compensation.online.online_kernel import next_set_point
from compensation.online.point_source import compile_stage
from tests.builders.point_streams import FORWARD, drive, planned, source_of

compile_stage(FORWARD)
compiled = len(next_set_point.signatures)
received = pickle.loads(pickle.dumps(FORWARD))  # as the cyclic task receives it
drive(source_of(received, planned().position))
print(json.dumps([compiled, len(next_set_point.signatures)]))
"""


def test_the_cyclic_task_compiles_nothing() -> None:
    """Compiling takes so long on a busy computer that the task counts as hung."""
    finished = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert json.loads(finished.stdout) == [1, 1]
