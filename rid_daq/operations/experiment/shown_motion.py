"""JSON document and display blocks of a designed motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import MotionSamples
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from rid_daq.blocks.block import AnyBlock, Cells, Column, Next, Table, Text, Verdict, table
from rid_daq.operations.experiment.design import DesignRequest, MotionDocument
from rid_daq.operations.experiment.excitation_search import Search
from rid_daq.operations.experiment.motion_design import DesignedMotion
from rid_daq.terminal.choices import Kind


@dataclass(frozen=True)
class _MultisineAxis:
    """Properties of one axis of a multisine."""

    joint: str
    unit: str
    lines: int
    rms_velocity: float
    crest_factor: float
    slow_amplitude: float
    velocity_percent: float
    acceleration_percent: float
    torque_percent: float | None


@dataclass(frozen=True)
class _ExcitationAxis:
    """Range of one axis of an excitation, and the fractions of the limits that it uses."""

    joint: str
    unit: str
    position_min: float
    position_max: float
    velocity: float
    velocity_percent: float
    acceleration: float
    acceleration_percent: float


def motion_document(designed: DesignedMotion, output: Path) -> MotionDocument:
    """Return the properties of a motion as numbers.

    Args:
        designed: The motion.
        output: Path of its file.
    """
    motion, found = designed.motion, designed.found
    shown: MotionDocument = {
        "motion": str(output),
        "duration_s": designed.samples.duration_s,
        "notes": list(designed.notes),
    }
    match motion:
        case FourierMotion():
            axes = _excitation_axes(designed.samples, designed.cell.robot)
            shown["condition_number"] = designed.condition
            shown["axes"] = [asdict(axis) for axis in axes]
            if found is not None:
                shown["limits"] = [
                    {
                        "what": use.what,
                        "used": use.used,
                        "limit": use.limit,
                        "unit": use.unit,
                        "held": use.is_met,
                        "active": use.active,
                    }
                    for use in found.best.check.uses
                ]
                shown["trials"] = [
                    {
                        "elapsed_s": trial.elapsed_s,
                        "seed": trial.seed,
                        "worth": trial.objective,
                        "broken": trial.broken,
                    }
                    for trial in found.trials
                ]
                shown["interrupted"] = found.interrupted_by is not None
        case MultisineMotion():
            shown["kind"] = motion.kind
            shown["band_hz"] = [motion.lowest_hz, motion.highest_hz]
            shown["axes"] = [asdict(axis) for axis in _multisine_axes(designed, motion)]
        case _:
            shown["kind"] = motion.kind
    return shown


def designed_motion_blocks(designed: DesignedMotion, request: DesignRequest) -> Iterator[AnyBlock]:
    """Yield the content of a motion file, the course of the search, and the next commands.

    Args:
        designed: The motion.
        request: The request.
    """
    motion, duration_s = designed.motion, designed.samples.duration_s
    for note in designed.notes:
        yield Text(text=note)
    sentence = Text(
        text=f"{request.output}: {motion.describe()} Total duration {duration_s:.0f} s."
    )
    match motion:
        case FourierMotion():
            yield from _excitation_blocks(designed, motion, request.output)
        case MultisineMotion():
            yield sentence
            yield from _multisine_blocks(_multisine_axes(designed, motion))
            if not request.multisine.slow:
                yield Text(
                    text="Without the slow sine, the joints can stick: estimates of inertia and"
                    " stability margins are then wrong."
                )
        case _:
            yield sentence
            if (named := motion.joint_table()) is not None:
                heads, rows = named
                columns = tuple(Column(title=head, is_text=True) for head in heads)
                yield Table(columns=columns, rows=tuple(rows))
    yield Next(words=("record", request.cell, str(request.output)))
    if request.kind is Kind.MULTISINE:
        yield Next(words=("loop", "latest"))


def _multisine_axes(designed: DesignedMotion, motion: MultisineMotion) -> list[_MultisineAxis]:
    robot = designed.cell.robot
    assert designed.use is not None
    settings = {excited.joint: excited for excited in motion.joints}
    return [
        _MultisineAxis(
            joint=joint.name,
            unit=joint.unit,
            lines=len(lines),
            rms_velocity=settings[joint.name].velocity,
            crest_factor=crest,
            slow_amplitude=settings[joint.name].slow_amplitude,
            velocity_percent=100.0 * float(shares[0]),
            acceleration_percent=100.0 * float(shares[1]),
            torque_percent=100.0 * float(shares[2]) if shares[2] > 0.0 else None,
        )
        for joint, lines, crest, shares in zip(
            robot.joints,
            motion.excited_lines(robot),
            motion.crest_factors(robot),
            designed.use,
            strict=True,
        )
    ]


def _multisine_blocks(axes: list[_MultisineAxis]) -> Iterator[AnyBlock]:
    yield table(
        axes,
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("lines", lambda axis: axis.lines),
        Cells("RMS speed [unit/s]", lambda axis: axis.rms_velocity, digits=3),
        Cells("crest factor", lambda axis: axis.crest_factor, digits=3),
        Cells("slow sine", lambda axis: axis.slow_amplitude, digits=3),
        Cells("speed / limit", lambda axis: axis.velocity_percent, "%", 3),
        Cells("acceleration / limit", lambda axis: axis.acceleration_percent, "%", 3),
        Cells("torque / limit", lambda axis: axis.torque_percent, "%", 3),
    )
    if any(axis.torque_percent is None for axis in axes):
        yield Text(
            text="The torque is predicted only if the robot file has `cad`, or with --model."
        )


def _excitation_axes(samples: MotionSamples, robot: RobotDescription) -> list[_ExcitationAxis]:
    velocity = np.abs(samples.velocity).max(axis=0)
    acceleration = np.abs(samples.acceleration).max(axis=0)
    return [
        _ExcitationAxis(
            joint=joint.name,
            unit=joint.unit,
            position_min=float(samples.position[:, column].min()),
            position_max=float(samples.position[:, column].max()),
            velocity=float(velocity[column]),
            velocity_percent=float(100.0 * velocity[column] / joint.limits.velocity),
            acceleration=float(acceleration[column]),
            acceleration_percent=float(100.0 * acceleration[column] / joint.limits.acceleration),
        )
        for column, joint in enumerate(robot.joints)
    ]


def _excitation_blocks(
    designed: DesignedMotion, motion: FourierMotion, output: Path
) -> Iterator[AnyBlock]:
    samples, found = designed.samples, designed.found
    if found is not None and found.interrupted_by is not None:
        yield Verdict(
            passed=None, text="The search was interrupted: this is the best motion found so far."
        )
    yield Text(
        text=f"{output}: {motion.periods} periods of {motion.period_s:g} s, total duration"
        f" {samples.duration_s:.1f} s, condition number {designed.condition:.4g}. The limits"
        " are also checked between the samples."
    )
    yield table(
        _excitation_axes(samples, designed.cell.robot),
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("from", lambda axis: axis.position_min),
        Cells("to", lambda axis: axis.position_max),
        Cells("largest speed [unit/s]", lambda axis: axis.velocity),
        Cells("speed / limit", lambda axis: axis.velocity_percent, "%", 3),
        Cells("largest acceleration [unit/s²]", lambda axis: axis.acceleration),
        Cells("acceleration / limit", lambda axis: axis.acceleration_percent, "%", 3),
    )
    if found is not None:
        for sentence in _search_sentences(found, designed.cell.config):
            yield Text(text=sentence)


def _search_sentences(found: Search, cell: CellConfig) -> Iterator[str]:
    """Yield sentences about the search, and about torques and distances of the motion."""
    curve = "; ".join(
        f"{found.criterion.describe(trial.objective)} after {trial.elapsed_s:.1f} s"
        for trial in found.curve
    )
    broken = sum(bool(trial.broken) for trial in found.trials)
    yield f"{len(found.trials)} starts, {broken} rejected. Improvements: {curve}."
    uses = found.best.check.uses
    torques = [use for use in uses if use.what.startswith("torque")]
    yield (
        f"Largest predicted torque of each axis: {_shares_text(torques)} % of the planning limit."
        if torques
        else "Torque is not checked: the robot file has no `cad`, and no --model is given."
    )
    if cell.plate is not None and cell.plate.limits is not None:
        base = [use for use in uses if use.what.endswith("on the base")]
        yield (
            f"Largest predicted reaction on the base, Fx to Mz: {_shares_text(base)} % of the"
            " limit."
            if base
            else "The reaction on the base is not checked: it needs a combined model (--model)."
        )
    nearest = min(
        (use for use in uses if use.unit == "m" and use.what.startswith("distance")),
        key=lambda use: use.used,
        default=None,
    )
    yield (
        f"Smallest distance: {1000.0 * nearest.used:.0f} mm, {nearest.what}."
        if nearest is not None
        else "Collisions are not checked: the cell has no `workspace`, and the robot has no pair"
        " of `bodies` to check (neighbours and pairs in `may_touch` are excluded)."
    )
    active = [use.what for use in uses if use.active]
    yield f"Active limits: {', '.join(active) or 'none'}."


def _shares_text(uses: list[Any]) -> str:
    return ", ".join(f"{100.0 * use.used / use.limit:.0f}" for use in uses)
