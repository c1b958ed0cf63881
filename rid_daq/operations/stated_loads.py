"""`state_loads`: the model of a robot with its payload before and after each change of the load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.motion.load_changes import LoadChanges, read_load_changes
from acquisition.motion.samples import MotionSamples
from compensation.ramped_load import RampedLoad, without_periods
from config.errors import ConfigError
from config.formats.approved_files import sha256_of
from identification.estimation.estimate import Estimate
from rid_daq.operations.stated_payload import (
    LoadedModel,
    load_content,
    model_with_content,
    state_payload,
)
from rid_daq.runs.changed_load import LOAD_CHANGES, load_changes_bytes
from rid_daq.terminal.choices import NO_PAYLOAD, PAYLOAD_OF_MODEL


@dataclass(frozen=True)
class StatedChanges:
    """Changes of the load during a motion, as a request states them.

    Attributes:
        file: The load-change file.
        changes: The changes; payload files are named by their SHA-256.
        contents: Bytes of the payload file of each change; empty for `model` and `none`.
    """

    file: Path
    changes: LoadChanges
    contents: tuple[bytes, ...]

    def planned(self, samples: MotionSamples, *, signals: bool = False) -> MotionSamples:
        """Return a motion that does not count as periodic, because its periods have other loads.

        Args:
            samples: The motion.
            signals: True if the motion can wait for signals.

        Raises:
            ConfigError: A change ends after the motion, or begins at a signal although `signals` is
                False.
        """
        if self.changes.signals and not signals:
            raise ConfigError(
                f"{self.file}: a change begins at a signal, but only `stream` computes the torques"
                " during the motion: use `stream`, or remove the key `signal`",
                code="RID-LOAD-SIGNAL",
            )
        self.changes.refuse_late(samples, str(self.file))
        return without_periods(samples)

    @property
    def files(self) -> dict[str, bytes]:
        """Content by name of the files with which a run stores the changes."""
        found = {LOAD_CHANGES: load_changes_bytes(self.changes)}
        for number, content in enumerate(self.contents, start=1):
            if content:
                found[f"load_change_{number}.json"] = content
        return found

    def model(
        self, estimate: Estimate, name: Path, first: LoadedModel, runs: Path
    ) -> tuple[Estimate, ...]:
        """Return the robot with its first payload, and with the payload of each change.

        Args:
            estimate: Model of the robot, as in its file.
            name: Name of the model, for messages.
            first: The robot with its first payload.
            runs: Folder of the run folders.

        Raises:
            ConfigError, EstimationError, RecordingError: As raised by `state_payload`.
        """
        models = [first.estimate]
        for change, content in zip(self.changes.changes, self.contents, strict=True):
            if content:
                models.append(model_with_content(estimate, content, self.file))
            else:
                models.append(state_payload(estimate, name, change.payload, runs).estimate)
        return tuple(models)


@dataclass(frozen=True)
class StatedLoads:
    """Models of a robot with its payloads during a motion.

    Attributes:
        first: The robot with the payload at the beginning.
        estimates: The robot with the first payload, and after each change.
        stated: The changes; None if the load does not change.
    """

    first: LoadedModel
    estimates: tuple[Estimate, ...]
    stated: StatedChanges | None = None

    @property
    def changes(self) -> LoadChanges | None:
        """The changes; None if the load does not change."""
        return None if self.stated is None else self.stated.changes

    def planned(self, samples: MotionSamples, *, signals: bool = False) -> MotionSamples:
        """Return a motion as it is planned for these loads (`StatedChanges.planned`)."""
        return samples if self.stated is None else self.stated.planned(samples, signals=signals)

    def over_time(self, adapt: Callable[[Estimate], Estimate]) -> Estimate | RampedLoad:
        """Return the model of the whole motion; a function adapts each estimate first."""
        adapted = tuple(map(adapt, self.estimates))
        if self.changes is None:
            return adapted[0]
        return RampedLoad(
            adapted,
            np.array([each.at_s for each in self.changes.changes]),
            np.array([each.ramp_s for each in self.changes.changes]),
        )

    def as_driven(self, recorded: LoadChanges | None) -> Estimate | RampedLoad:
        """Return the model of a driven motion, with each change that occurred, at its actual time.

        Args:
            recorded: The changes that the run stores.
        """
        if recorded is None:
            return self.estimates[0]
        pairs = list(zip(recorded.changes, self.estimates[1:], strict=True))
        came = [(each, one) for each, one in pairs if each.begin_s is not None]
        return RampedLoad(
            (self.estimates[0], *(one for _, one in came)),
            np.array([each.begin_s for each, _ in came]),
            np.array([each.ramp_s for each, _ in came]),
        )


def read_stated_changes(path: Path) -> StatedChanges:
    """Return the changes of a load-change file, with the payload files that it names.

    Raises:
        ConfigError: A file is missing or invalid.
    """
    read = read_load_changes(path)
    changes, contents = [], []
    for change in read.changes:
        content = b""
        if change.payload not in (NO_PAYLOAD, PAYLOAD_OF_MODEL):
            file = path.expanduser().parent / change.payload
            content = load_content(file)
            change = change.model_copy(update={"payload": sha256_of(content)})
        # only runs contain what was observed
        change = change.model_copy(update={"came_s": None, "outcome": None})
        changes.append(change)
        contents.append(content)
    return StatedChanges(path, read.model_copy(update={"changes": tuple(changes)}), tuple(contents))


def state_loads(
    estimate: Estimate, model: Path, payload: str | None, changes: Path | None, runs: Path
) -> StatedLoads:
    """Return the models of a robot with the payload at the beginning and after each change.

    Args:
        estimate, model, payload, runs: As for `state_payload`.
        changes: Load-change file; None if the load does not change.

    Raises:
        ConfigError: The load-change file is invalid, or as raised by `state_payload`.
        EstimationError, RecordingError: As raised by `state_payload`.
    """
    first = state_payload(estimate, model, payload, runs)
    if changes is None:
        return StatedLoads(first, (first.estimate,))
    stated = read_stated_changes(changes)
    return StatedLoads(first, stated.model(estimate, model, first, runs), stated)


def require_same_changes(
    stated: LoadChanges | None, recorded: LoadChanges | None, name: str
) -> None:
    """Refuse a run or a feedforward whose changes of the load differ from those of a request.

    Args:
        stated: Changes that the request states.
        recorded: Changes of the run or of the feedforward file.
        name: Name of the run or file, for messages.

    Raises:
        ConfigError: The changes differ.
    """
    if recorded is None and stated is None:
        return
    if recorded is None:
        raise ConfigError(
            f"{name}: its payload does not change during the motion: leave --load-changes out",
            code="RID-LOAD-CHANGES",
        )
    if stated is None or not stated.has_same_loads(recorded):
        given = "no" if stated is None else "another"
        raise ConfigError(
            f"{name}: its payload changes during the motion, at {recorded.times}, but {given}"
            " load-change file is given: give the same file with --load-changes",
            code="RID-LOAD-CHANGES",
        )
