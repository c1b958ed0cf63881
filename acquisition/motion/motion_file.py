"""Motion files: list of the kinds of motion, and functions that read a file."""

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
from acquisition.motion.kinds.pose_sequence import PoseSequenceMotion
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
    | PoseSequenceMotion
    | TimedPathMotion,
    Field(discriminator="kind"),
]
MOTION_KINDS: Final = tuple(
    str(get_args(motion.model_fields["kind"].annotation)[0])
    for motion in get_args(get_args(AnyMotion)[0])
)
"""Permitted values of the key `kind`."""


class MotionFile(RootModel[AnyMotion]):
    """A motion file; its key `kind` selects the kind of motion."""


def load_motion(path: str | Path) -> AnyMotion:
    """Load a motion file, with the rows of a table that it names.

    Args:
        path: The file.

    Raises:
        ConfigError: The file, or a file that it names, is missing or invalid.
    """
    return read_motion(path)[0]


def read_motion(path: str | Path) -> tuple[AnyMotion, bytes]:
    """Return the motion of a file, and the text that a run stores, from one reading of the file.

    The text is that of the file, except for a motion with rows in another file: then the text
    contains these rows. Parameters and errors are those of `load_motion`.
    """
    written, name, _ = read_named(str(path), "motions", None)
    motion = parse_motion(written, name).with_file_data(Path(path).expanduser().parent)
    return motion, motion.to_keep(written)


def parse_motion(written: bytes, name: str) -> AnyMotion:
    """Return the motion in a file's contents, without the table that it may name.

    Raises:
        ConfigError: The contents are not valid YAML, or not a motion.
    """
    return validate(parse_yaml(written, name), MotionFile).root
