"""The catalogue of operations, and how one of them is imported."""

from __future__ import annotations

import functools
import importlib
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from rid_daq.operations.operation import Operation


class Entry(NamedTuple):
    """An operation in the program's help: its room, its section, its summary."""

    room: str
    section: str
    summary: str


CATALOGUE: Final = {
    "reset": Entry(
        "cell", "Cell", "reset the faults of a cell's drives, once their causes are gone"
    ),
    "friction": Entry("identify", "Identify", "measure friction alone, from runs made for it"),
    "compare": Entry("identify", "Identify", "compare two estimates of one robot"),
    "loop": Entry("path", "Path", "measure the velocity loops of the drives, from a multisine run"),
    "retime": Entry("path", "Path", "drive a path as fast as the torque limits of a model allow"),
    "compensate": Entry("path", "Path", "compute the feedforward that makes a motion accurate"),
    "refine": Entry("path", "Path", "correct a feedforward by the error that remained with it"),
    "tracking": Entry("path", "Path", "compare measured with commanded positions"),
    "recover": Entry("runs", "Runs", "write the readable part of a damaged recording as a new one"),
}
"""Every operation by its name; its module is `rid_daq.operations.ROOM.NAME`."""


@functools.cache
def operation(name: str) -> Operation:
    """Import and return an operation.

    Parameters
    ----------
    name : str
        Its name in the catalogue.

    Raises
    ------
    KeyError
        There is none of this name.
    """
    module = importlib.import_module(f"rid_daq.operations.{CATALOGUE[name].room}.{name}")
    found: Operation = module.OPERATION
    return found
