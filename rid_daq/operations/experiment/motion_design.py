"""`design_motion`: design a motion within the limits of a cell, and write it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.motion import Motion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from compensation.loops.multisine_motion import MultisineOptions, limit_use, multisine_motion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from identification.design.task import criterion_of_options, excitation_problem
from identification.design.two_harmonic import (
    TwoHarmonicOptions,
    condition_number,
    design_two_harmonic,
)
from identification.elasticity.limit_torque import limit_temperature_note
from identification.estimation.estimate import Estimate, refuse_external_model
from identification.friction.motions import constant_velocity_motion, reversed_motion
from rid_daq.operations.cell_files import read_estimate_for, rejection_notes
from rid_daq.operations.experiment.design import (
    EXCITATION_PERIOD_S,
    DesignRequest,
    Multisine,
)
from rid_daq.operations.experiment.excitation_search import Search, search
from rid_daq.operations.operation import Context
from rid_daq.operations.rigid_gears import rigid_gears_notes
from rid_daq.operations.stated_payload import state_payload
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.choices import Kind

HARMONICS: Final = 5
HEURISTIC_HARMONICS: Final = 8
REALISATIONS: Final = 4


@dataclass(frozen=True)
class DesignedMotion:
    """A motion that was designed and written.

    Attributes:
        cell: Cell of the motion.
        samples: The planned motion.
        condition: Condition number of an excitation; None for other motions.
        found: Result of the search for the motion; None without a search.
        use: Shape (joints, 3). Largest fractions of speed, acceleration and torque limit that a
            multisine uses; None for other motions.
        notes: Sentences about the motion that a person should read.
    """

    cell: LoadedCell
    motion: AnyMotion
    samples: MotionSamples
    condition: float | None = None
    found: Search | None = None
    use: FloatArray | None = None
    notes: tuple[str, ...] = ()


def design_motion(request: DesignRequest, context: Context) -> DesignedMotion:
    """Design a motion, check its limits, and write it.

    Position, speed and acceleration are checked in the ramps too.

    Args:
        request: Kind of motion and options.
        context: Shows progress.

    Raises:
        ConfigError: No such motion keeps the limits, a model is of another robot, or this kind of
            motion does not allow so many periods.
        EstimationError: The model or its payload cannot be used.
        RecordingError: The file cannot be written, or the model is in a damaged run.
    """
    refuse_output(request.output, request.overwrite, made_file.MOTION)
    _require_periods(request)
    cell = load_cell(request.cell)
    robot, config = cell.robot, cell.config
    match request.kind:
        case Kind.CONSTANT_VELOCITY:
            steady = constant_velocity_motion(robot, config.workspace, seed=request.seed)
            return DesignedMotion(cell, steady, _write_motion(request, cell, steady))
        case Kind.MULTISINE:
            return _design_multisine(request, cell)
        case Kind.EXCITATION | Kind.REVERSED:
            motion, origin, found = _design_excitation(request, cell, context)
    notes = _limit_notes(request, robot)
    if request.kind is Kind.REVERSED:
        back = reversed_motion(motion)
        samples = _write_motion(request, cell, back)
        return DesignedMotion(cell, back, samples, found=found, notes=notes)
    condition = condition_number(robot, motion)
    comment = (
        f"Excitation for robot {robot.name}, verified within its limits at {config.cycle_time_ms}"
        f" ms.\nCondition number {condition:.4g}; {origin}"
    )
    samples = _write_motion(request, cell, motion, comment)
    return DesignedMotion(cell, motion, samples, condition, found, notes=notes)


def _require_periods(request: DesignRequest) -> None:
    """Refuse more periods than this kind of motion file allows."""
    multisine = request.kind is Kind.MULTISINE
    periods = (request.multisine if multisine else request.excitation).periods
    kinds: dict[Kind, type[Motion]] = {
        Kind.MULTISINE: MultisineMotion,
        Kind.REVERSED: ReversedMotion,
    }
    limits = kinds.get(request.kind, FourierMotion).model_fields["periods"].metadata
    most = next(int(limit.le) for limit in limits if hasattr(limit, "le"))
    if periods > most:
        raise ConfigError(
            f"--periods {periods}: a motion of kind {request.kind.value} has at most {most}"
            " periods",
            code="RID-OPTION-RANGE",
        )


def _design_excitation(
    request: DesignRequest, cell: LoadedCell, context: Context
) -> tuple[FourierMotion, str, Search | None]:
    """Return an excitation, its origin as a sentence, and the result of its search, if any."""
    robot, config, how = cell.robot, cell.config, request.excitation
    cycle_s = config.cycle_time_s
    period_s = how.period_s or round(round(EXCITATION_PERIOD_S / cycle_s) * cycle_s, 9)
    if how.method == "two-harmonic":
        options = TwoHarmonicOptions(
            period_s,
            how.harmonics or HEURISTIC_HARMONICS,
            how.limit_fraction,
            how.tries,
            how.seed,
            how.periods,
        )
        motion = design_two_harmonic(robot, options, cycle_s, workspace=config.workspace)
        return (
            motion,
            (f"the best of {how.tries} random motions with two harmonics, seed {how.seed}."),
            None,
        )
    problem = excitation_problem(
        config,
        robot,
        period_s=period_s,
        harmonics=how.harmonics or HARMONICS,
        criterion=criterion_of_options(robot, how.criterion, how.wanted),
        model=_limit_model(request, robot),
        given=_given_models(request.given, robot, despite_misfit=request.despite_misfit),
    )
    found = search(problem, config, how, context, request.scheduler)
    origin = (
        f"the best of {len(found.trials)} random first guesses (--seed {how.seed}; its own seed is"
        f" {found.best.seed}) for {', '.join(how.wanted) or how.criterion}:"
        f" {problem.criterion.describe(found.best.check.objective)}."
    )
    return found.best.motion, origin, found


def _given_models(
    paths: Sequence[Path], robot: RobotDescription, *, despite_misfit: bool
) -> list[Estimate]:
    """Return the models of earlier runs; no run may count twice."""
    models: dict[Path, Estimate] = {}
    for path in paths:
        model = read_estimate_for(path, robot, despite_misfit=despite_misfit)
        for other, earlier in models.items():
            shared = sorted(set(model.run_ids) & set(earlier.run_ids))
            if shared or path == other or np.array_equal(model.values, earlier.values):
                of = f"run {shared[0]}" if shared else "the same runs"
                raise ConfigError(
                    f"--given {path}: contains the information of {of}, as --given {other} does,"
                    " and would count twice: give models of different runs",
                    code="RID-OPTION-EXCLUSIVE",
                )
        models[path] = model
    return list(models.values())


def _design_multisine(request: DesignRequest, cell: LoadedCell) -> DesignedMotion:
    robot = cell.robot
    estimate = _limit_model(request, robot)
    if estimate is not None:
        refuse_external_model(estimate)
    motion = multisine_motion(robot, cell.config, _multisine_options(request.multisine), estimate)
    samples = _write_motion(request, cell, motion)
    warmth = "" if estimate is None else limit_temperature_note(estimate)
    use = limit_use(samples, robot, estimate)
    notes: tuple[str, ...] = (warmth,) if warmth else ()
    if request.model is not None and estimate is not None:
        notes += tuple(f"note: {note}" for note in rejection_notes(request.model, estimate))
    return DesignedMotion(cell, motion, samples, use=use, notes=notes)


def _limit_model(request: DesignRequest, robot: RobotDescription) -> Estimate | None:
    """Return the model for the torque limits, with the payload; None without one."""
    if request.model is None:
        return None
    estimate = read_estimate_for(request.model, robot, despite_misfit=request.despite_misfit)
    return state_payload(estimate, request.model, request.payload, request.runs).estimate


def _limit_notes(request: DesignRequest, robot: RobotDescription) -> tuple[str, ...]:
    """Return notes on the torques that the search for an excitation compares with the limits."""
    if request.model is None:
        return ()
    estimate = read_estimate_for(request.model, robot, despite_misfit=request.despite_misfit)
    rigid = rigid_gears_notes(
        request.model,
        estimate,
        "the search keeps the limits with the torques of rigid gears; `record --model` compares the"
        " torques of the motors with the limits",
    )
    notes = (*rejection_notes(request.model, estimate), *rigid)
    return tuple(f"note: {note}" for note in notes)


def _multisine_options(asked: Multisine) -> MultisineOptions:
    usual = 1 if asked.phases == "schroeder" else REALISATIONS
    return MultisineOptions(
        asked.band_hz,
        asked.period_s,
        asked.periods,
        asked.realisations or usual,
        asked.grid,
        asked.phases,
        asked.slow,
        asked.seed,
    )


def _write_motion(
    request: DesignRequest, cell: LoadedCell, motion: AnyMotion, comment: str = ""
) -> MotionSamples:
    """Plan a motion within the limits, write its file, and return the planned motion."""
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    comment = comment or (
        f"For robot {cell.robot.name}, verified within its limits at {cell.config.cycle_time_ms}"
        f" ms. {motion.describe()}"
    )
    write_whole(request.output, to_yaml(motion, comment).encode())
    return samples
