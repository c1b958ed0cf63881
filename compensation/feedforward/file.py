"""Feedforward file: a motion and its precompensated speeds, written by `rid-daq compensate`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from acquisition.motion.load_changes import LoadChanges
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from compensation.feedforward.inverse import FeedforwardTuning
from compensation.feedforward.tuning import Tuning
from compensation.ramped_load import without_periods
from config.arrays import FloatArray
from config.cell.cycle_time import CycleTimeMs, as_milliseconds
from config.errors import ConfigError
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel

FORMAT: Final = "rid-daq feedforward 1"
LARGEST_FILE_BYTES: Final = 500_000_000


class TuningEntry(ConfigModel):
    """Tuning of the feedforward by a reference run, per joint, base to flange.

    `used` is false for a joint that the run does not excite enough. `applied_scale` and
    `applied_delay_s` are 1 and 0 for such a joint, and if the run shows no significant difference
    from these values.
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
        """Return the entry for a tuning; `same_motion` is true if its run has the same motion."""
        return cls.from_attributes(
            found,
            run=run,
            same_motion=same_motion,
            applied_scale=found.tuning.scale,
            applied_delay_s=found.tuning.delay_s,
        )

    def as_tuning(self) -> FeedforwardTuning:
        """Return the tuning that was applied."""
        return FeedforwardTuning(np.array(self.applied_scale), np.array(self.applied_delay_s))


class RefinementEntry(ConfigModel):
    """One step of refinement: its runs, the error that remained in them, and the convergence bound.

    Attributes:
        rms: RMS of each joint's mean error [rad or m].
        over_noise: Power of each joint's mean error divided by the power of the noise.
        noise_limit: Largest `over_noise` at which the error cannot be distinguished from noise.
        bound: Largest fraction of each joint's error that can remain after one step, for
            frequencies up to `band_hz`.
    """

    runs: tuple[str, ...]
    rms: tuple[float, ...]
    over_noise: tuple[float, ...]
    noise_limit: float
    bound: tuple[float, ...]
    band_hz: float


class FeedforwardOrigin(ConfigModel):
    """Origin of a feedforward: files are named by their SHA-256, runs by their ids.

    Attributes:
        payload: The payload in the model: the SHA-256 of its file, `model`, or `none`; empty if the
            user did not state a payload.
        load_changes: Changes of the payload during the motion; None if it does not change.
        temperature: Assumed temperature of the joints, as in `at_operating_temperature`; empty if
            friction does not depend on temperature.
    """

    model_sha256: str = ""
    loops_sha256: str = ""
    payload: str = ""
    load_changes: LoadChanges | None = None
    temperature: str = ""
    tuning: TuningEntry | None = None
    refinements: tuple[RefinementEntry, ...] = ()


class FeedforwardFile(ConfigModel):
    """Feedforward speeds that are added to the output of the position loop, for each planned row.

    `feedforward` has one row per cycle and one column per joint, base to flange [rad/s or m/s].
    `deflection` has the same shape: lead of the motors over the planned positions, with which
    elastic gears move the links as planned [rad or m]; null for rigid gears.
    """

    format: Literal["rid-daq feedforward 1"]
    cycle_time_ms: CycleTimeMs
    joints: tuple[str, ...]
    motion: AnyMotion
    origin: FeedforwardOrigin = FeedforwardOrigin()
    feedforward: tuple[tuple[float, ...], ...] = Field(min_length=2)
    deflection: tuple[tuple[float, ...], ...] | None = None

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        for key, rows in (("feedforward", self.feedforward), ("deflection", self.deflection or ())):
            for number, row in enumerate(rows):
                if len(row) != len(self.joints):
                    raise ValueError(
                        f"row {number} of {key} has {len(row)} numbers for {len(self.joints)}"
                        " joints; compensate the motion again"
                    )
        return self

    def onto(self, samples: MotionSamples) -> MotionSamples:
        """Return the planned motion with this feedforward, and with the deflection of the gears.

        Raises:
            ConfigError: The feedforward belongs to another motion, cycle time or robot.
        """
        rows, samples = np.array(self.feedforward, dtype=float), samples.whole()
        if self.origin.load_changes is not None:
            samples = without_periods(samples)
        cycle_ms = as_milliseconds(samples.sample_period_s)
        if (
            rows.shape != samples.position.shape
            or self.joints != samples.joint_names
            or cycle_ms != self.cycle_time_ms
        ):
            raise ConfigError(
                f"the feedforward has {len(rows)} rows of {self.cycle_time_ms} ms for joints"
                f" {', '.join(self.joints)}; the motion has {len(samples)} rows of {cycle_ms} ms"
                f" for {', '.join(samples.joint_names)}: compensate the motion again for this cell",
                code="RID-FEEDFORWARD-OTHER-MOTION",
            )
        bent = self.bent_rows(len(rows))
        if bent is None:
            return replace(samples, feedforward=rows)
        turning = np.gradient(bent, samples.sample_period_s, axis=0)
        return replace(
            samples,
            position=samples.position + bent,
            velocity=samples.velocity + turning,
            acceleration=samples.acceleration
            + np.gradient(turning, samples.sample_period_s, axis=0),
            feedforward=rows,
        )

    def bent_rows(self, rows: int) -> FloatArray | None:
        """Return the deflection of each planned row, (rows, n) [rad or m]; None for rigid gears.

        Raises:
            ConfigError: The number of rows or of joints is wrong.
        """
        if self.deflection is None:
            return None
        bent = np.array(self.deflection, dtype=float)
        if bent.shape != (rows, len(self.joints)):
            raise ConfigError(
                f"the feedforward has a deflection of shape {bent.shape} for {rows} rows of"
                f" {len(self.joints)} joints: compensate the motion again for this cell",
                code="RID-FEEDFORWARD-OTHER-MOTION",
            )
        return bent


def write_feedforward(
    path: Path,
    motion: AnyMotion,
    samples: MotionSamples,
    origin: FeedforwardOrigin | None = None,
    deflection: FloatArray | None = None,
) -> None:
    """Write a compensated motion and its sources; the file is written completely or not at all.

    Raises:
        RecordingError: The file cannot be written.
    """
    write_whole(path, feedforward_bytes(motion, samples, origin, deflection))


def feedforward_bytes(
    motion: AnyMotion,
    samples: MotionSamples,
    origin: FeedforwardOrigin | None = None,
    deflection: FloatArray | None = None,
) -> bytes:
    """Return the content of a feedforward file.

    Args:
        deflection: Shape (samples, n). Deflection of elastic gears; None for rigid gears.
    """
    assert samples.feedforward is not None
    file = FeedforwardFile(
        format=FORMAT,
        cycle_time_ms=as_milliseconds(samples.sample_period_s),
        joints=samples.joint_names,
        motion=motion,
        origin=origin or FeedforwardOrigin(),
        feedforward=tuple(map(tuple, np.round(samples.feedforward, 9).tolist())),
        deflection=(
            None if deflection is None else tuple(map(tuple, np.round(deflection, 10).tolist()))
        ),
    )
    return (file.model_dump_json() + "\n").encode()


def read_feedforward(path: Path) -> FeedforwardFile:
    """Read a feedforward file.

    Raises:
        ConfigError: The file cannot be read or is not a feedforward file.
    """
    return feedforward_content(read_content(path, LARGEST_FILE_BYTES), path)


def feedforward_content(data: bytes, path: Path) -> FeedforwardFile:
    """Parse the content of a feedforward file; see `read_feedforward`."""
    what = "a feedforward file of `rid-daq compensate`"
    return json_content(data, path, FeedforwardFile, what)
