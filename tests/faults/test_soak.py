"""Several faults, one after the other, in one cell: a short version of `benchmarks.soak`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks.soak import soak
from benchmarks.soak_faults import FAULTS

# a fault of the program acts on the program's own child processes
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("new_python_processes")]

EVERY_S = 16.0
# The first fault leaves a drive in fault, which must be reset before the second.
NAMES = ("a drive's fault", "the recorder is killed")


@pytest.mark.fault(36)
def test_every_fault_gets_its_reaction_without_leaks(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    faults = tuple(fault for name in NAMES for fault in FAULTS if fault.name == name)
    found = soak(len(faults) * EVERY_S / 3600.0, EVERY_S, 1, tmp_path, faults=faults)
    assert found.wrong == []
    assert found.faults == len(faults)
    assert not any(tmp_path.iterdir())
    assert max(whole for _, whole in found.growth().values()) < 5.0
    assert not any(count > 0 for count in found.leaks().values())
    measured(
        f"{found.faults} faults in {3600.0 * found.hours[-1]:.0f} simulated s: all reactions"
        " correct, 0 file descriptors leaked; benchmarks.soak runs for hours"
    )
