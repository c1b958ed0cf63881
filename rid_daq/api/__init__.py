"""Identify a robot from Python: the functions behind the command line, on arrays and objects.

    from rid_daq.api import Robot, identify, read_recording, validate

    robot = Robot.load("ur10e")                  # or Robot.from_urdf("arm.urdf")
    train = read_recording("50sec.csv", map="ur10e_31", rows="355-5090")
    model = identify(train, robot=robot)
    print(validate(model, read_recording("ptp.csv", map="ur10e_31", rows="700-4200")))

The names in `__all__` are public. Their version is `API_VERSION`, by the rules of semantic
versioning: a name, a parameter or an attribute is removed or changes its meaning only in a new
major version. All other Python names of rid-daq may change at any time.

- Arrays of a motion have the shape (samples, joints), joints from base to flange. Positions are in
  rad (m for a prismatic joint), their derivatives per second. Most other names end in their unit.
- Wrong arguments, files and data raise a `RidDaqError` with a stable code (`error.refusal`, such
  as RID-FILE-READ).
- Nothing is printed. `identify`, `design` and the jobs of a `Cell` have the parameter `progress`,
  which is called with the name of the step, the amount done and the total.
- Only `save` and `Cell` write files, apart from temporary ones, which are deleted. Ctrl-C leaves
  no file half-written.

`model.py`, `recording.py` and `robot.py` contain the classes; begin to read with `estimation.py`.
This package computes little itself: it calls `rid_daq.operations` and the packages below.
"""

from rid_daq.own_packages import hidden_package

if hidden := hidden_package():
    raise ImportError(hidden)

from config.errors import RidDaqError
from rid_daq.api.cell import Cell
from rid_daq.api.compensation import Feedforward, compensate
from rid_daq.api.estimation import identify, validate
from rid_daq.api.model import Model
from rid_daq.api.motion import Motion, design, retime
from rid_daq.api.parameter import Parameter
from rid_daq.api.payload import Payload, identify_payload
from rid_daq.api.plotting import plot
from rid_daq.api.proposed_map import ProposedMap, propose_map
from rid_daq.api.recording import Recording, read_recording
from rid_daq.api.robot import Robot
from rid_daq.api.validation import Validation

API_VERSION = "1.0"

__all__ = [
    "API_VERSION",
    "Cell",
    "Feedforward",
    "Model",
    "Motion",
    "Parameter",
    "Payload",
    "ProposedMap",
    "Recording",
    "RidDaqError",
    "Robot",
    "Validation",
    "compensate",
    "design",
    "identify",
    "identify_payload",
    "plot",
    "propose_map",
    "read_recording",
    "retime",
    "validate",
]


def __dir__() -> list[str]:
    """Return the public names only; modules of this package are not public."""
    return list(__all__)
