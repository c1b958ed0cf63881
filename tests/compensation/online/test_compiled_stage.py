"""The kernels of the on-line compensation are compiled before the cyclic task begins."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

PROGRAM = """
import json
import pickle
from dataclasses import replace

from compensation.online.online_kernel import next_set_point
from compensation.online.path_kernels import take_points
from compensation.online.point_source import compile_stage
from compensation.online.rate_kernels import cut_path
from acquisition.motion.load_changes import LoadChange
from tests.builders.load_signals import change, follow, forward_of, from_time, source_of

KERNELS = next_set_point, take_points, cut_path
forward = forward_of({change})
compile_stage(forward)
compiled = [len(kernel.signatures) for kernel in KERNELS]
received = pickle.loads(pickle.dumps(replace(forward, signals=None)))  # as the task receives it
follow(source_of(replace(received, signals=forward.signals)), from_time(1.0))
print(json.dumps([compiled, [len(kernel.signatures) for kernel in KERNELS]]))
"""


@pytest.mark.parametrize(
    "change",
    ["change()", "LoadChange(at_s=1.0, payload='model', ramp_s=0.1)"],
    ids=["a load at a signal", "a load at a stated time"],
)
def test_the_cyclic_task_compiles_nothing(change: str) -> None:
    """Compiling takes so long on a busy computer that the task counts as hung."""
    program = PROGRAM.replace("{change}", change)
    finished = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    before, after = json.loads(finished.stdout)
    assert before == after
    assert before[0] == 1
