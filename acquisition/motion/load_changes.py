"""`LoadChanges`: payloads that a robot takes up or puts down during a motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, field_validator, model_validator

from acquisition.motion.load_signal import LoadSignal, ShortS
from acquisition.motion.samples import MotionSamples
from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import read_named, validate
from config.model import ConfigModel
from config.plausible import PhysicalFile, Plausible

MOST_CHANGES: Final = 64
ChangeOutcome = Literal[
    "not_reached", "awaited", "begun", "came", "missed", "not_needed", "already_active"
]
"""Outcome of a load change in a motion; `LoadChange` describes the values."""

Seconds = Annotated[float, Field(ge=0.0), Plausible(0.0, 86_400.0, "s")]
LateS = Annotated[float, Plausible(-86_400.0, 86_400.0, "s")]
RampS = Annotated[float, Field(gt=0.0), Plausible(1e-3, 10.0, "s")]


class SimulatedChange(ConfigModel):
    """Change of the payload of a simulated robot; a real robot ignores it.

    Attributes:
        payload: Name of a payload in the plant file; `none` for an empty flange.
        late_s: Delay of the true change after `at_s`; negative if it comes earlier.
        ramp_s: True load-transfer time; that of the change if not set.
        signal_delay_s: Time from the beginning of the true change until the gripper's switch is
            actuated.
        bounce_s: Time for which the contact of the switch then bounces.
        fault: `never_closes`: the gripper misses the part. The payload does not change, and the
            switch is not actuated. `stuck`: the switch is actuated from the beginning.
    """

    payload: str
    late_s: LateS = 0.0
    ramp_s: RampS | None = None
    signal_delay_s: ShortS = 0.0
    bounce_s: ShortS = 0.0
    fault: Literal["never_closes", "stuck"] | None = None


class LoadChange(ConfigModel):
    """One change of the payload on the flange.

    Attributes:
        at_s: Beginning of the change, from the first row of the motion; with a signal, the expected
            beginning.
        payload: Payload after the change: the name of a payload file or of a YAML file with known
            `bodies` in the folder of this file; `model` for the payload in the model; or `none`. In
            a copy that a run or a feedforward file contains, a file is named by its SHA-256.
        ramp_s: Load-transfer time: over it, the parameters of the load change linearly.
        signal: Signal at which the change begins; without it, the change begins at `at_s`.
        came_s: In the copy of a run that was driven, the time at which the signal came; missing if
            it did not come.
        outcome: In the copy of a run with signals: `begun` at its stated time; the signal `came`;
            it was `missed`, because it did not come in its window; it was still `awaited` when the
            motion ended; it was `not_needed`, because the robot carried this load already; its
            input was `already_active` before it was awaited; or the change was `not_reached`.
            Missing if it is not known.
        simulated: Change of a simulated robot's payload; without it, its payload does not change.
    """

    at_s: Seconds
    payload: str
    ramp_s: RampS
    signal: LoadSignal | None = None
    came_s: Seconds | None = None
    outcome: ChangeOutcome | None = None
    simulated: SimulatedChange | None = None

    @field_validator("payload")
    @classmethod
    def _check_name(cls, payload: str) -> str:
        if not payload or payload in (".", "..") or Path(payload).name != payload:
            raise ValueError(
                f"invalid payload {payload!r}: give the name of a payload file in the folder of"
                " this file, `model`, or `none`"
            )
        return payload

    @model_validator(mode="after")
    def _check_window(self) -> Self:
        if self.earliest_s < 0.0:
            raise ValueError(
                f"the signal is expected from {self.earliest_s:g} s on, before the motion begins:"
                " give a later at_s or a smaller early_s"
            )
        return self

    @property
    def earliest_s(self) -> float:
        """Earliest time at which the change is expected to begin."""
        return self.at_s - (0.0 if self.signal is None else self.signal.early_s)

    @property
    def latest_s(self) -> float:
        """Latest time at which the change is expected to begin."""
        return self.at_s + (0.0 if self.signal is None else self.signal.late_s)

    @property
    def lateness_s(self) -> float | None:
        """Time by which the signal came after `at_s`, negative if before; None if it did not."""
        return None if self.came_s is None else self.came_s - self.at_s

    @property
    def begin_s(self) -> float | None:
        """Time at which the change began in a run; None if it did not begin."""
        if self.signal is not None:
            return self.came_s
        return None if self.outcome == "not_reached" else self.at_s

    @property
    def in_window(self) -> bool:
        """True if the signal came in the time in which it is expected."""
        return self.came_s is not None and self.earliest_s <= self.came_s <= self.latest_s

    @property
    def end_s(self) -> float:
        """Latest time at which the new load has been taken up completely."""
        debounce_s = 0.0 if self.signal is None else self.signal.debounce_s
        return self.latest_s + max(self.ramp_s, debounce_s)


class LoadChanges(PhysicalFile):
    """A load-change file.

    Attributes:
        changes: The changes in the order of time; each begins after the end of the previous one.
    """

    changes: tuple[LoadChange, ...] = Field(min_length=1, max_length=MOST_CHANGES)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        simulated_s = 0.0
        for number, change in enumerate(self.changes):
            before_s = self.changes[number - 1].end_s if number else 0.0
            if change.earliest_s < before_s:
                raise ValueError(
                    f"change {number + 1} begins at {change.earliest_s:g} s, before the previous"
                    f" one ends at {before_s:g} s: give a later at_s or a shorter ramp_s"
                )
            if change.simulated is not None:
                begin_s = change.at_s + change.simulated.late_s
                if begin_s < simulated_s:
                    raise ValueError(
                        f"change {number + 1}: the simulated change begins at {begin_s:g} s, before"
                        f" the previous one ends at {simulated_s:g} s: correct late_s or ramp_s"
                    )
                if begin_s < 0.0:
                    raise ValueError(
                        f"change {number + 1}: the simulated change begins at {begin_s:g} s, before"
                        " the motion: correct late_s"
                    )
                simulated_s = begin_s + (change.simulated.ramp_s or change.ramp_s)
        return self

    def has_same_loads(self, other: LoadChanges) -> bool:
        """Return True if times, signals and payloads are stated equally.

        Those of simulated robots, and what was observed in a run, are not compared.
        """
        unstated = {"simulated": None, "came_s": None, "outcome": None}
        own, others = (
            [change.model_copy(update=unstated) for change in each.changes]
            for each in (self, other)
        )
        return own == others

    @property
    def signals(self) -> bool:
        """True if a change begins at a signal."""
        return any(change.signal is not None for change in self.changes)

    @property
    def times(self) -> str:
        """Stated times of the changes, as a phrase."""
        return ", ".join(f"{change.at_s:g} s" for change in self.changes)

    def refuse_late(self, samples: MotionSamples, name: str) -> None:
        """Refuse a change that is not complete at the end of a motion.

        Raises:
            ConfigError: A change ends after the motion.
        """
        last = self.changes[-1]
        if last.end_s > samples.duration_s:
            raise ConfigError(
                f"{name}: change {len(self.changes)} ends at {last.end_s:g} s, but the motion ends"
                f" at {samples.duration_s:.6g} s: give an earlier at_s",
                code="RID-LOAD-CHANGE-TIME",
            )


def read_load_changes(path: Path) -> LoadChanges:
    """Return the content of a load-change file.

    Raises:
        ConfigError: The file is missing or invalid.
    """
    written, name, _ = read_named(str(path), "motions", None)
    return load_changes_content(written, name)


def load_changes_content(written: bytes, name: str) -> LoadChanges:
    """Return load changes from the bytes of a file; `name` is the file's name, for messages.

    Raises:
        ConfigError: The bytes are not valid YAML, or not load changes.
    """
    return validate(parse_yaml(written, name), LoadChanges)
