"""Catalogue of all operations, and the function that imports an operation by its name."""

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
"""Sections of the program's help, in order."""


class Entry(NamedTuple):
    """An operation in the program's help.

    Attributes:
        subpackage: Folder of the operation's module, below `rid_daq/operations`.
        section: Section of the help; empty for an operation of a group.
        summary: One line for the help.
        is_job: True if a service also performs the operation, as a job.
    """

    subpackage: str
    section: str
    summary: str
    is_job: bool = True


class Group(NamedTuple):
    """Operations with the same first word, such as `drives backup` and `drives restore`.

    Attributes:
        section: Section of the help.
        summary: One line for the help.
        help: Help of the first word alone.
        default: Second word that is assumed if the user types none.
        metavar: Placeholder of the argument that follows if the second word is omitted.
    """

    section: str
    summary: str
    help: str
    default: str = ""
    metavar: str = ""


GROUPS: Final = {
    "drives": Group(
        "Cell",
        "save the drives' settings, restore them, undo the writes of a run",
        "Settings of the drives: save them, restore them, or undo the writes of a run.",
    ),
    "plate": Group(
        "Cell", "zero the force plate under the robot", "The force plate under the robot."
    ),
    "calibrate": Group(
        "Identify",
        "calibrate the robot's kinematics from a laser tracker's positions (`calibrate ROBOT`)",
        "Kinematic calibration: geometry and gear stiffness from measured positions of one point."
        " `rid-daq calibrate ROBOT POSES` is short for `rid-daq calibrate kinematics ROBOT POSES`.",
        default="kinematics",
        metavar="ROBOT",
    ),
    "payload": Group(
        "Payload",
        "identify the robot's payload (`payload CELL`); load data for its controller",
        "Identify a robot's payload: mass, centre of gravity and inertia, from recordings with"
        " and without it. Write the result in the format of a robot controller. `rid-daq payload"
        " CELL` is short for `rid-daq payload session CELL`, which leads through all steps.",
        default="session",
        metavar="CELL",
    ),
}
"""First words of the operations whose names have two words."""


def local(subpackage: str, section: str, summary: str) -> Entry:
    """Return the entry of an operation that a service does not offer as a job."""
    return Entry(subpackage, section, summary, is_job=False)


CATALOGUE: Final = {
    "demo": local(
        "start",
        "Begin",
        "demonstration of all steps on the bundled simulated cell, with a report; no hardware",
    ),
    "init": local("start", "Begin", "write commented example files: cell, robot and motion"),
    "docs": local(
        "start", "Begin", "open the documentation in the browser: guides, reference, theory"
    ),
    "check": Entry(
        "cell",
        "Cell",
        "preflight: check devices and safety settings; do not move a cell with a red line",
    ),
    "reset": Entry(
        "cell", "Cell", "reset the faults of a cell's drives after their causes are removed"
    ),
    "drives backup": local("cell.drives", "", "save the settings of a cell's drives to a file"),
    "drives restore": local("cell.drives", "", "restore the drives' settings from a backup"),
    "drives rollback": local("cell.drives", "", "undo the writes of a run to the drives"),
    "drives fit": local(
        "cell.drives", "", "print the cell file keys for a drive, from its data sheet (EDS)"
    ),
    "mock": local("cell", "Cell", "serve a cell's simulated devices on their bus until stopped"),
    "stop": local("cell", "Cell", "quick stop of the session that runs on this computer"),
    "identify": Entry(
        "identify", "Identify", "estimate the robot's parameters from one or more runs"
    ),
    "validate": Entry(
        "identify",
        "Identify",
        "predict another run's torques and check the error against the limits",
    ),
    "axes": Entry(
        "cell", "Cell", "test direction, encoder and gear of every axis before the first motion"
    ),
    "jog": Entry(
        "cell", "Cell", "move one joint at a time, or go to the home pose, while a key is held"
    ),
    "watch": Entry(
        "cell", "Cell", "read the drives at rest, without power: positions, torques, temperatures"
    ),
    "plate zero": Entry(
        "cell",
        "",
        "measure the force plate's offsets: read, turn axis 1 by half a turn, read again",
    ),
    "record": Entry("experiment", "Experiment", "run a motion on a cell and record it"),
    "stream": Entry(
        "path",
        "Path",
        "follow a path with online compensation, from a file or from another program",
    ),
    "friction": Entry(
        "identify", "Identify", "measure the friction of each joint, from runs designed for it"
    ),
    "design": Entry(
        "experiment",
        "Experiment",
        "design a motion for an experiment, check it against the limits, write the motion file",
    ),
    "import": local("experiment", "Experiment", "import a recording of another program as a run"),
    "average": local(
        "experiment", "Experiment", "cut a run into periods, reject bad ones, average the rest"
    ),
    "calibrate kinematics": Entry(
        "calibration", "", "identify geometry and gear stiffness from measured positions"
    ),
    "calibrate poses": Entry(
        "calibration", "", "propose the poses to measure for a kinematic calibration"
    ),
    "compare": Entry("identify", "Identify", "compare two runs or models of the same robot"),
    "export": Entry("identify", "Identify", "write a model or a recording for other programs"),
    "report": local("runs", "Identify", "write a run's report again from its results"),
    "payload session": Entry(
        "payload",
        "",
        "payload session step by step: check, warm up, record, identify, check the result",
    ),
    "payload identify": Entry(
        "payload", "", "identify mass, centre of gravity and inertia from recorded runs"
    ),
    "payload export": Entry("payload", "", "write load data in the format of a robot controller"),
    "payload read-back": Entry("payload", "", "compare load data of a controller with a payload"),
    "payload certificate": Entry(
        "payload", "", "write the certificate of a payload, ready to sign"
    ),
    "sensitivity": local(
        "identify",
        "Payload",
        "effect of errors in the robot's known parameters on a payload estimate",
    ),
    "stiffness": Entry(
        "calibration",
        "Identify",
        "identify stiffness and damping of elastic gears, from excitation and multisine runs",
    ),
    "loop": Entry("path", "Path", "measure the velocity loops of the drives, from a multisine run"),
    "retime": Entry(
        "path", "Path", "compute the fastest timing of a path within the torque limits of a model"
    ),
    "compensate": Entry(
        "path", "Path", "compute the feedforward that reduces a motion's path error"
    ),
    "refine": Entry(
        "path", "Path", "correct a feedforward by the path error that was measured with it"
    ),
    "tracking": Entry("path", "Path", "compare measured with commanded positions"),
    "runs": local("runs", "Runs", "list the runs; with --verify, check their files for changes"),
    "recover": Entry("runs", "Runs", "write the readable part of a damaged recording as a new one"),
    "serve": local(
        "service", "Service", "serve cells to browsers and programs: jobs, runs and the workbench"
    ),
    "token": local(
        "service",
        "Service",
        "make a token for a program or device that uses a service of this computer",
    ),
}
"""All operations by name. A name consists of the words of the command.

`identifier` returns the name of the operation's module. If that is a keyword of Python, such as
`import`, the module's name ends in `_`.
"""


def identifier(name: str) -> str:
    """Return an operation's name in the spelling of modules and services, such as `plate_zero`."""
    return name.replace(" ", "_").replace("-", "_")


OF_KINDS: Final = {identifier(name): name for name, entry in CATALOGUE.items() if entry.is_job}
"""Names of the operations that are jobs, by kind of job."""


@functools.cache
def operation(name: str) -> Operation:
    """Import and return an operation.

    Args:
        name: Its name in the catalogue.

    Raises:
        KeyError: The catalogue has no operation of this name.
    """
    file = f"{name}_" if keyword.iskeyword(name) else identifier(name)
    module = importlib.import_module(f"rid_daq.operations.{CATALOGUE[name].subpackage}.{file}")
    found: Operation = module.OPERATION
    return found
