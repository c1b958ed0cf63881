"""`ComparisonSection`: candidates of friction terms, and which was chosen for each joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rid_daq.report.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts
from rid_daq.terminal.console import Console

if TYPE_CHECKING:
    from identification.validation.friction_selection import Comparison
    from identification.validation.presliding_choice import PreslidingChoice
    from identification.validation.stribeck_choice import StribeckChoice


_BESIDES = ("presliding", "stribeck", "temperature")
"""What is chosen beside the candidates."""


class FrictionTrial(Section):
    """One candidate.

    Attributes
    ----------
    terms : tuple of str
        Friction of every joint; empty where each joint has its own.
    error : tuple of float
        RMS error on what the fit left out, one a joint [N m or N].
    parameters : int
        Their number.
    aic, bic : float
        Akaike's and the Bayesian information criterion.
    """

    terms: Texts
    error: Numbers
    parameters: int
    aic: float
    bic: float


class MemoryTrial(Section):
    """What friction with memory is worth, standstill and reversal included.

    Attributes
    ----------
    distance : tuple of float or None
        Presliding distance of each joint that has it [rad or m].
    without, with_memory : tuple of float
        RMS error of each joint on what the fit left out [N m or N].
    share : tuple of float or None
        Share of each joint's friction that gives way so; None in results of earlier versions, where
        all of it does.
    """

    distance: tuple[float | None, ...]
    without: Numbers
    with_memory: Numbers
    share: Numbers | None = None

    @property
    def shown_shares(self) -> tuple[float | None, ...]:
        """The share of each joint that has a distance."""
        shares = self.share or (1.0,) * len(self.distance)
        return tuple(
            None if distance is None else share
            for distance, share in zip(self.distance, shares, strict=True)
        )


class StribeckTrial(Section):
    """What friction that is larger at low speed is worth, beside memory.

    Attributes
    ----------
    speed : tuple of float or None
        Stribeck speed of each joint that has it [rad/s or m/s].
    without, with_stribeck : tuple of float
        RMS error of each joint on what the fit left out [N m or N].
    """

    speed: tuple[float | None, ...]
    without: Numbers
    with_stribeck: Numbers

    def sentences(self, joints: Texts) -> Texts:
        """Say what was found."""
        return tuple(
            f"The friction of {joint} is larger at low speed, with a Stribeck speed of"
            f" {number(speed, 3)}: the RMS error on parts left out is {number(after, 4)} with it"
            f" and {number(before, 4)} without."
            for joint, speed, before, after in zip(
                joints, self.speed, self.without, self.with_stribeck, strict=True
            )
            if speed is not None
        )


class ChannelTrial(Section):
    """What the recorded torque went through.

    Attributes
    ----------
    bandwidth_hz : float or None
        Where it was low-passed; None for nowhere that the recording shows.
    delay_s, delay_sigma_s : tuple of float
        By how much each joint's torque is late, with its standard deviation; 0 where nothing was
        found [s].
    """

    bandwidth_hz: float | None
    delay_s: Numbers
    delay_sigma_s: Numbers

    def sentences(self, joints: Texts) -> Texts:
        """Say what was found."""
        said = []
        if self.bandwidth_hz is not None:
            said.append(
                f"The torque was low-passed at {number(self.bandwidth_hz, 3)} Hz before it was"
                " recorded: the model's torque is, too, where they are compared."
            )
        said += [
            f"The torque of {joint} is {number(1e3 * abs(late), 3)} ms"
            f" {'late' if late > 0.0 else 'early'} (± {number(1e3 * sigma, 2)} ms)."
            for joint, late, sigma in zip(joints, self.delay_s, self.delay_sigma_s, strict=True)
            if late
        ]
        return tuple(said)


class WarmingTrial(Section):
    """How joints warm up by their own friction, where no temperature was measured.

    Attributes
    ----------
    time_constant_s, time_constant_sigma_s : tuple of float
        Of each joint, with its standard deviation; 0 where its friction does not show it [s].
    """

    time_constant_s: Numbers
    time_constant_sigma_s: Numbers

    def sentences(self, joints: Texts) -> Texts:
        """Say what was found."""
        return tuple(
            f"The friction of {joint} changes as it warms up, with a time constant of"
            f" {number(value, 3)} s (± {number(sigma, 2)} s)."
            for joint, value, sigma in zip(
                joints, self.time_constant_s, self.time_constant_sigma_s, strict=True
            )
            if value
        )


class ComparisonSection(Section):
    """How candidates of friction terms compare, and what was chosen.

    Attributes
    ----------
    joints : tuple of str
        The joints' names.
    chosen : dict of tuple of str
        The terms of each joint, by its name.
    trials : tuple of FrictionTrial
        The candidates, and last what was chosen, all joints together.
    memory : MemoryTrial or None
        The same of friction with memory; None in results of earlier versions.
    stribeck : StribeckTrial or None
        The same of Stribeck friction; None in results of earlier versions, which had it among the
        candidates.
    channel : ChannelTrial or None
        What the recorded torque went through; None where nothing was found.
    warming : WarmingTrial or None
        How joints warm up; None where no friction shows it.
    refused_delay_s : tuple of float or None
        Delays of each joint's torque that no bus explains and that are not in the model, 0 for the
        other joints [s]; None if there is no such delay.
    """

    joints: Texts
    chosen: dict[str, Texts]
    trials: tuple[FrictionTrial, ...]
    memory: MemoryTrial | None = None
    stribeck: StribeckTrial | None = None
    channel: ChannelTrial | None = None
    warming: WarmingTrial | None = None
    refused_delay_s: Numbers | None = None

    @classmethod
    def of(cls, comparison: Comparison) -> ComparisonSection:
        """Return how candidates compare."""
        return cls(
            joints=comparison.joint_names,
            chosen=dict(zip(comparison.joint_names, _terms(comparison), strict=True)),
            trials=tuple(
                FrictionTrial.taken(trial, error=trial.error_nm)
                for trial in (*comparison.trials, comparison.combined)
            ),
            memory=None if comparison.presliding is None else _memory(comparison.presliding),
            stribeck=None if comparison.stribeck is None else _slow(comparison.stribeck),
            channel=(
                None if comparison.channel is None else ChannelTrial.taken(comparison.channel)
            ),
            warming=(
                None if comparison.warming is None else WarmingTrial.taken(comparison.warming)
            ),
            refused_delay_s=comparison.refused_delay_s or None,
        )

    def _has(self, joint: str, terms: Texts) -> bool:
        return tuple(term for term in self.chosen[joint] if term not in _BESIDES) == terms

    def print(self, console: Console) -> None:
        """Print the candidates, and what each is chosen for."""
        console.say("Friction terms, judged on parts of the runs that each fit left out:")
        console.table(
            ("friction terms", *self.joints, "AIC", "BIC", "chosen for"),
            [
                (
                    ", ".join(trial.terms) or "each joint its own",
                    *(number(error, 4) for error in trial.error),
                    f"{trial.aic:.0f}",
                    f"{trial.bic:.0f}",
                    ", ".join(joint for joint in self.joints if self._has(joint, trial.terms)),
                )
                for trial in self.trials
            ],
        )
        console.say(
            "RMS error on moving samples [N m or N]. Each joint has the simplest terms within one"
            " standard error of its best."
        )
        if self.memory is not None:
            console.say("Friction with memory, judged with standstill and reversal:")
            console.table(
                ("RMS error", *self.joints),
                [
                    ("without memory", *(number(e, 4) for e in self.memory.without)),
                    ("with memory", *(number(e, 4) for e in self.memory.with_memory)),
                    (
                        "presliding distance, where it is chosen",
                        *("-" if d is None else number(d, 3) for d in self.memory.distance),
                    ),
                    (
                        "share of the friction that gives way",
                        *("-" if s is None else number(s, 2) for s in self.memory.shown_shares),
                    ),
                ],
            )
        if self.stribeck is not None:
            for sentence in self.stribeck.sentences(self.joints):
                console.say(sentence)
        if self.warming is not None:
            for sentence in self.warming.sentences(self.joints):
                console.say(sentence)
        if self.channel is not None:
            for sentence in self.channel.sentences(self.joints):
                console.say(sentence)


def _terms(comparison: Comparison) -> list[Texts]:
    memory = comparison.presliding
    distances = (None,) * len(comparison.chosen) if memory is None else memory.distances
    slow = comparison.stribeck
    speeds = (None,) * len(comparison.chosen) if slow is None else slow.speeds
    warming = comparison.warming
    warms = (False,) * len(comparison.chosen) if warming is None else warming.joints.tolist()
    return [
        (
            *(term for term in terms if term != "stribeck" or slow is None),
            *(() if distance is None else ("presliding",)),
            *(() if speed is None else ("stribeck",)),
            *(("temperature",) if warm else ()),
        )
        for terms, distance, speed, warm in zip(
            comparison.chosen, distances, speeds, warms, strict=True
        )
    ]


def _memory(choice: PreslidingChoice) -> MemoryTrial:
    without, remembering = choice.error_nm.tolist()
    return MemoryTrial(
        distance=choice.distances,
        without=tuple(without),
        with_memory=tuple(remembering),
        share=choice.shares,
    )


def _slow(choice: StribeckChoice) -> StribeckTrial:
    without, slow = choice.error_nm.tolist()
    return StribeckTrial(speed=choice.speeds, without=tuple(without), with_stribeck=tuple(slow))
