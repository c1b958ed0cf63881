"""The catalogue of operations, and how one of them is imported."""

from __future__ import annotations

import functools
import importlib
import keyword
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from rid_daq.operations.operation import Operation


SECTIONS: Final = (
    "Begin",
    "Cell",
    "Experiment",
    "Identify",
    "Payload",
    "Path",
    "Runs",
    "Service",
)
"""The sections of the program's help, in their order."""


class Entry(NamedTuple):
    """An operation in the program's help: its room, its section (none in a group), its summary.

    `is_job` is true if a service does it too, as a job.
    """

    room: str
    section: str
    summary: str
    is_job: bool = True


class Group(NamedTuple):
    """Operations with the same first word: section, summary, help of the word alone.

    `default` is the second word that is meant if there is none, `metavar` what follows then.
    """

    section: str
    summary: str
    help: str
    default: str = ""
    metavar: str = ""


GROUPS: Final = {
    "drives": Group(
        "Cell",
        "keep what the drives hold, put it back, undo what a run wrote",
        "What the drives hold: keep it, put it back, or undo what a run wrote.",
    ),
    "plate": Group(
        "Cell", "zero the force plate under the robot", "The force plate under the robot."
    ),
    "payload": Group(
        "Payload",
        "identify what the robot carries (`payload CELL`); load data for its controller",
        "Identify what a robot carries: mass, centre of gravity and inertia, from recordings with"
        " and without it; and write them as its controller wants them. `rid-daq payload CELL` leads"
        " through all of it: it is `rid-daq payload session CELL`.",
        default="session",
        metavar="CELL",
    ),
}
"""The first words of operations whose names have two."""


def local(room: str, section: str, summary: str) -> Entry:
    """Return the entry of an operation that no service does."""
    return Entry(room, section, summary, is_job=False)


CATALOGUE: Final = {
    "demo": local(
        "start",
        "Begin",
        "the whole story on the bundled simulated cell, with a report, no hardware",
    ),
    "init": local("start", "Begin", "write a commented cell, robot and motion to start from"),
    "docs": local("start", "Begin", "the documentation, in the browser: guides, reference, theory"),
    "check": Entry(
        "cell", "Cell", "preflight: every device, every safety setting; any red means no motion"
    ),
    "reset": Entry(
        "cell", "Cell", "reset the faults of a cell's drives, once their causes are gone"
    ),
    "drives backup": local("cell.drives", "", "every setting of a cell's drives into a file"),
    "drives restore": local("cell.drives", "", "the drives hold what a backup says"),
    "drives rollback": local("cell.drives", "", "what a run wrote to the drives, undone"),
    "drives fit": local("cell.drives", "", "the keys that a drive's data sheet needs"),
    "mock": local("cell", "Cell", "serve a cell's simulated devices on their bus until stopped"),
    "stop": local("cell", "Cell", "quick stop of whatever session is running on this machine"),
    "identify": Entry(
        "identify", "Identify", "estimate the robot's parameters from one or more runs"
    ),
    "validate": Entry("identify", "Identify", "predict another run's torques and judge the error"),
    "axes": Entry(
        "cell", "Cell", "test direction, encoder and gear of every axis, before the first motion"
    ),
    "jog": Entry(
        "cell", "Cell", "move one joint at a time, or go to the home pose, while a key is held"
    ),
    "plate zero": Entry("cell", "", "the plate's offsets: read, turn axis 1 by half a turn, read"),
    "record": Entry("experiment", "Experiment", "run a motion on a cell and record it"),
    "stream": Entry(
        "path", "Path", "follow a path more closely, live: from a file or from another program"
    ),
    "friction": Entry("identify", "Identify", "measure friction alone, from runs made for it"),
    "design": Entry(
        "experiment",
        "Experiment",
        "choose an excitation, verify it against the limits, write the motion file",
    ),
    "import": local("experiment", "Experiment", "import a CSV file or ROS bag into a run folder"),
    "average": local(
        "experiment", "Experiment", "cut a run into periods, reject bad ones, average the rest"
    ),
    "compare": Entry("identify", "Identify", "compare two estimates of one robot"),
    "export": Entry("identify", "Identify", "write a model or a recording for other programs"),
    "report": local("identify", "Identify", "write a run's report again from its results"),
    "payload session": Entry(
        "payload", "", "lead through a session: check, warm up, record, identify, judge"
    ),
    "payload identify": Entry(
        "payload", "", "mass, centre of gravity and inertia, from recorded runs"
    ),
    "payload export": Entry("payload", "", "load data in the format of a robot controller"),
    "payload read-back": Entry("payload", "", "compare load data of a controller with a payload"),
    "payload certificate": Entry("payload", "", "the certificate of a payload, to sign"),
    "sensitivity": local(
        "identify", "Payload", "effect of wrong knowledge of the robot on a payload's estimate"
    ),
    "loop": Entry("path", "Path", "measure the velocity loops of the drives, from a multisine run"),
    "retime": Entry("path", "Path", "drive a path as fast as the torque limits of a model allow"),
    "compensate": Entry("path", "Path", "compute the feedforward that makes a motion accurate"),
    "refine": Entry("path", "Path", "correct a feedforward by the error that remained with it"),
    "tracking": Entry("path", "Path", "compare measured with commanded positions"),
    "runs": local("runs", "Runs", "list the runs, and check that their files are unchanged"),
    "recover": Entry("runs", "Runs", "write the readable part of a damaged recording as a new one"),
    "serve": local(
        "service", "Service", "cells as a service: jobs, runs and a workbench in the browser"
    ),
    "token": local(
        "service", "Service", "let a program or a device in to a service of this computer"
    ),
}
"""Every operation by its name: the words of its command. Its module is `identifier` of it.

The module of a name that is a keyword of Python, such as `import`, ends in `_`.
"""


def identifier(name: str) -> str:
    """Return a name as a module and the service have it, such as `plate_zero` for `plate zero`."""
    return name.replace(" ", "_").replace("-", "_")


OF_KINDS: Final = {identifier(name): name for name, entry in CATALOGUE.items() if entry.is_job}
"""The names of operations by the kinds of jobs."""


@functools.cache
def operation(name: str) -> Operation:
    """Import and return an operation.

    Args:
        name: Its name in the catalogue.

    Raises:
        KeyError: There is none of this name.
    """
    file = f"{name}_" if keyword.iskeyword(name) else identifier(name)
    module = importlib.import_module(f"rid_daq.operations.{CATALOGUE[name].room}.{file}")
    found: Operation = module.OPERATION
    return found
