"""The file that `rid-daq compensate` writes: a motion and the speeds that pre-compensate it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.inverse import FeedforwardTuning
from compensation.feedforward.tuning import Tuning
from config.errors import ConfigError
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel

FORMAT: Final = "rid-daq feedforward 1"
LARGEST_FILE_BYTES: Final = 500_000_000


class TuningEntry(ConfigModel):
    """How a reference run tuned the feedforward, joint by joint; base to flange.

    `used` is false for a joint that the run does not show well enough; `applied_scale` and
    `applied_delay_s` are 1 and 0 where the run cannot tell the value from them.
    """

    run: str
    same_motion: bool
    scale: tuple[float, ...]
    scale_std: tuple[float, ...]
    delay_s: tuple[float, ...]
    delay_std_s: tuple[float, ...]
    used: tuple[bool, ...]
    applied_scale: tuple[float, ...]
    applied_delay_s: tuple[float, ...]

    @classmethod
    def of(cls, found: Tuning, run: str, same_motion: bool) -> TuningEntry:
        """Return the entry of a tuning by a run, of the same motion or another."""
        return cls.taken(
            found,
            run=run,
            same_motion=same_motion,
            applied_scale=found.tuning.scale,
            applied_delay_s=found.tuning.delay_s,
        )

    def as_tuning(self) -> FeedforwardTuning:
        """Return what to compute with."""
        return FeedforwardTuning(np.array(self.applied_scale), np.array(self.applied_delay_s))


class RefinementEntry(ConfigModel):
    """One step of refinement: from which runs, what was missed in them, and the stated bound.

    `rms` is of the mean error of each joint [rad or m], `over_noise` its power over the noise's,
    `bound` what an error keeps of itself at most up to `band_hz`.
    """

    runs: tuple[str, ...]
    rms: tuple[float, ...]
    over_noise: tuple[float, ...]
    noise_limit: float
    bound: tuple[float, ...]
    band_hz: float


class Origin(ConfigModel):
    """What a feedforward was computed from: files by their SHA-256, runs by their ids.

    `temperature` is how warm the joints were taken to be, as `at_operation` has it; empty where
    friction does not depend on it.
    """

    model_sha256: str = ""
    loops_sha256: str = ""
    temperature: str = ""
    tuning: TuningEntry | None = None
    refinements: tuple[RefinementEntry, ...] = ()


class FeedforwardFile(ConfigModel):
    """Speeds to add in the position loop, row by row of the planned motion.

    `feedforward` has a row a cycle and a column a joint, base to flange [rad/s or m/s].
    """

    format: Literal["rid-daq feedforward 1"]
    cycle_time_ms: Annotated[int, Field(ge=1)]
    joints: tuple[str, ...]
    motion: AnyMotion
    origin: Origin = Origin()
    feedforward: tuple[tuple[float, ...], ...] = Field(min_length=2)

    def onto(self, samples: MotionSamples) -> MotionSamples:
        """Return the planned motion with this feedforward.

        Raises:
            ConfigError: It belongs to another motion, cycle time or robot.
        """
        rows, samples = np.array(self.feedforward, dtype=float), samples.whole()
        cycle_ms = round(1e3 * samples.sample_period_s)
        if (
            rows.shape != samples.position.shape
            or self.joints != samples.joint_names
            or cycle_ms != self.cycle_time_ms
        ):
            raise ConfigError(
                f"the feedforward is of {len(rows)} rows of {self.cycle_time_ms} ms for joints"
                f" {', '.join(self.joints)}; the motion has {len(samples)} rows of {cycle_ms} ms"
                f" for {', '.join(samples.joint_names)}: compensate it again for this cell",
                code="RID-FEEDFORWARD-OTHER-MOTION",
            )
        return replace(samples, feedforward=rows)


def write_feedforward(
    path: Path, motion: AnyMotion, samples: MotionSamples, origin: Origin | None = None
) -> None:
    """Write a compensated motion and what it was made from into a file, whole or not at all."""
    write_whole(path, feedforward_bytes(motion, samples, origin))


def feedforward_bytes(
    motion: AnyMotion, samples: MotionSamples, origin: Origin | None = None
) -> bytes:
    """Return what such a file holds."""
    assert samples.feedforward is not None
    file = FeedforwardFile(
        format=FORMAT,
        cycle_time_ms=round(1e3 * samples.sample_period_s),
        joints=samples.joint_names,
        motion=motion,
        origin=origin or Origin(),
        feedforward=tuple(map(tuple, np.round(samples.feedforward, 9).tolist())),
    )
    return (file.model_dump_json() + "\n").encode()


def read_feedforward(path: Path) -> FeedforwardFile:
    """Read such a file.

    Raises:
        ConfigError: It cannot be read or is none.
    """
    return feedforward_content(read_content(path, LARGEST_FILE_BYTES), path)


def feedforward_content(data: bytes, path: Path) -> FeedforwardFile:
    """Return what stands in the bytes of such a file; as `read_feedforward`."""
    what = "a feedforward file as `rid-daq compensate` writes it"
    return json_content(data, path, FeedforwardFile, what)
