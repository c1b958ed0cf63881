"""The motion file: every kind of motion, and how one is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, get_args

from pydantic import Field, RootModel

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.motion.kinds.joint_table import JointTableMotion
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.kinds.timed_path import TimedPathMotion
from acquisition.motion.kinds.tool_path import PathMotion
from config.formats.yaml_tree import parse_yaml
from config.load import read_named, validate

AnyMotion = Annotated[
    FourierMotion
    | MultipointMotion
    | ConstantVelocityMotion
    | ReversedMotion
    | MultisineMotion
    | CircleMotion
    | PathMotion
    | JointPathMotion
    | JointTableMotion
    | TimedPathMotion,
    Field(discriminator="kind"),
]
MOTION_KINDS: Final = tuple(
    str(get_args(motion.model_fields["kind"].annotation)[0])
    for motion in get_args(get_args(AnyMotion)[0])
)
"""What the key `kind` may say."""


class MotionFile(RootModel[AnyMotion]):
    """A motion file: its key `kind` says which of the motions it is."""


def load_motion(path: str | Path) -> AnyMotion:
    """Load a motion file; the rows of a table that it names are in what is returned.

    Args:
        path: The file.

    Raises:
        ConfigError: The file, or one that it names, is missing or invalid.
    """
    return read_motion(path)[0]


def read_motion(path: str | Path) -> tuple[AnyMotion, bytes]:
    """Return the motion of a file, and the text that a run keeps of it, both by one reading.

    The text is the file's, but for a motion that leaves its rows to another file: that one has them
    in it. Parameters and errors are those of `load_motion`.
    """
    written, name, _ = read_named(str(path), "motions", None)
    motion = motion_content(written, name).completed(Path(path).expanduser().parent)
    return motion, motion.to_keep(written)


def motion_content(written: bytes, name: str) -> AnyMotion:
    """Return the motion in the bytes of a file called `name`; a table that it names is not read."""
    return validate(parse_yaml(written, name), MotionFile).root
