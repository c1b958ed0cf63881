"""`ComparisonSection`: the friction terms and the torque channel that `--choose` selected."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rid_daq.blocks.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts

if TYPE_CHECKING:
    from identification.validation.model_choice import ModelChoice
    from identification.validation.presliding_choice import PreslidingChoice


class MemoryTrial(Section):
    """Improvement by presliding friction, on held-out data including standstill and reversal.

    Attributes:
        distance: Presliding distance of each joint [rad or m]; null for a joint without presliding.
        without: RMS error of each joint without presliding, on data that the fit left out [N m or
            N].
        with_memory: RMS error of each joint with presliding, on data that the fit left out [N m or
            N].
        share: Presliding fraction of each joint's friction.
    """

    distance: tuple[float | None, ...]
    without: Numbers
    with_memory: Numbers
    share: Numbers

    @property
    def shown_shares(self) -> tuple[float | None, ...]:
        """Presliding fraction of each joint; None for a joint without a presliding distance."""
        return tuple(
            None if distance is None else share
            for distance, share in zip(self.distance, self.share, strict=True)
        )


class ChannelTrial(Section):
    """Delay and filter of the recorded torque, joint by joint.

    Attributes:
        kind: none, delay, lag, zero-phase, or delay + lag.
        delay_s: Delay of the torque [s]; negative if the position is late; 0 if none was found.
        delay_sigma_s: Standard deviation of the delay [s].
        lag_s: Time constant of the first-order filter [s]; 0 if no such filter was found.
        lag_sigma_s: Standard deviation of the time constant [s].
        width_s: Width of the zero-phase filter [s]; 0 if no such filter was found.
        width_sigma_s: Standard deviation of the width [s].
        order: Order of the zero-phase filter.
    """

    kind: str
    delay_s: Numbers
    delay_sigma_s: Numbers
    lag_s: Numbers
    lag_sigma_s: Numbers
    width_s: Numbers
    width_sigma_s: Numbers
    order: int = 1

    def sentences(self, joints: Texts) -> Texts:
        """Return one sentence for each delay and filter that was found."""
        sentences = []
        for j, joint in enumerate(joints):
            if late := self.delay_s[j]:
                sentences.append(
                    f"The torque of {joint} is {number(1e3 * abs(late), 3)} ms"
                    f" {'late' if late > 0.0 else 'early'}"
                    f" (± {number(3e3 * self.delay_sigma_s[j], 2)} ms, 3 sigma)."
                )
            if lag := self.lag_s[j]:
                sentences.append(
                    f"The torque of {joint} passed a first-order filter with a time constant of"
                    f" {number(1e3 * lag, 3)} ms ({number(0.5 / math.pi / lag, 3)} Hz;"
                    f" ± {number(3e3 * self.lag_sigma_s[j], 2)} ms, 3 sigma)."
                )
            if width := self.width_s[j]:
                sentences.append(
                    f"The torque of {joint} passed a zero-phase filter of order {self.order} with a"
                    f" width of {number(1e3 * width, 3)} ms ({number(0.5 / math.pi / width, 3)} Hz;"
                    f" ± {number(3e3 * self.width_sigma_s[j], 2)} ms, 3 sigma)."
                )
        return tuple(sentences)


class WarmingTrial(Section):
    """Warming of joints by their own friction, without a measured temperature.

    Attributes:
        time_constant_s: Time constant of each joint's warming [s]; 0 if its friction shows no
            warming.
        time_constant_sigma_s: Standard deviation of each time constant [s].
    """

    time_constant_s: Numbers
    time_constant_sigma_s: Numbers

    def sentences(self, joints: Texts) -> Texts:
        """Return one sentence for each joint whose friction changes with warming."""
        return tuple(
            f"The friction of {joint} changes as it warms up, with a time constant of"
            f" {number(value, 3)} s (± {number(sigma, 2)} s)."
            for joint, value, sigma in zip(
                joints, self.time_constant_s, self.time_constant_sigma_s, strict=True
            )
            if value
        )


class ComparisonSection(Section):
    """The selected friction model, and its errors compared with Coulomb and viscous friction.

    Attributes:
        joints: Names of the joints.
        chosen: Friction terms of each joint, by the joint's name.
        plain: RMS error of each joint with Coulomb and viscous friction, on data that the fit left
            out [N m or N].
        with_terms: RMS error of each joint with the chosen terms, on data that the fit left out [N
            m or N].
        stribeck_speed: Stribeck speed of each joint [rad/s or m/s]; null for a joint without one.
        shear_thinning_speed: Speed of shear thinning of each joint [rad/s or m/s]; null for a
            joint without it. Left out if no joint has it.
        memory: Presliding; left out if the data do not identify it.
        channel: Delay and filter of the recorded torque; left out if none was found.
        warming: Warming of joints; left out if no joint's friction shows it.
        refused_delay_s: For each joint, a delay of the torque that is too long to come from a bus
            [s]; 0 for a joint without one. The model does not contain these delays. Left out
            without such delays.
        refused_filter_s: For each joint, the longest time constant that was tried, if the filter of
            its torque is at least as slow [s]; 0 for a joint without one. The model does not
            contain these filters. Left out without such filters.
    """

    joints: Texts
    chosen: dict[str, Texts]
    plain: Numbers
    with_terms: Numbers
    stribeck_speed: tuple[float | None, ...]
    shear_thinning_speed: tuple[float | None, ...] | None = None
    memory: MemoryTrial | None = None
    channel: ChannelTrial | None = None
    warming: WarmingTrial | None = None
    refused_delay_s: Numbers | None = None
    refused_filter_s: Numbers | None = None

    @classmethod
    def of(cls, choice: ModelChoice) -> ComparisonSection:
        """Return the section for the choice of a model."""
        plain, with_terms = choice.error_nm.tolist()
        return cls(
            joints=choice.joint_names,
            chosen=dict(zip(choice.joint_names, _terms(choice), strict=True)),
            plain=tuple(plain),
            with_terms=tuple(with_terms),
            stribeck_speed=choice.stribeck_rad_s,
            shear_thinning_speed=choice.thinning_rad_s if any(choice.thinning_rad_s) else None,
            memory=None if choice.presliding is None else _memory(choice.presliding),
            channel=ChannelTrial.from_attributes(choice.channel)
            if choice.channel.changes
            else None,
            warming=None
            if choice.warming is None
            else WarmingTrial.from_attributes(choice.warming),
            refused_delay_s=choice.refused.delay_s if any(choice.refused.delay_s) else None,
            refused_filter_s=choice.refused.filter_s if any(choice.refused.filter_s) else None,
        )


def _terms(choice: ModelChoice) -> list[Texts]:
    presliding, warming = choice.presliding, choice.warming
    distances = (None,) * len(choice.terms) if presliding is None else presliding.distances
    warms = (False,) * len(choice.terms) if warming is None else warming.joints.tolist()
    return [
        (
            *terms,
            *(() if distance is None else ("presliding",)),
            *(("temperature",) if warm else ()),
        )
        for terms, distance, warm in zip(choice.terms, distances, warms, strict=True)
    ]


def _memory(choice: PreslidingChoice) -> MemoryTrial:
    without, with_presliding = choice.error_nm.tolist()
    return MemoryTrial(
        distance=choice.distances,
        without=tuple(without),
        with_memory=tuple(with_presliding),
        share=choice.shares,
    )
