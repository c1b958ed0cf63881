"""Further friction terms that improve the prediction of held-out data.

The equations of all candidate terms are condensed once. A model with a candidate term contains a
subset of these columns, so its solution needs no second pass over the recordings. Load-dependent
friction is linearised at the estimate without it, and the other nonlinear parameters keep their
values.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.friction_functions import FRICTION_FUNCTIONS
from identification.equations.segments import thin_rows
from identification.equations.time_domain import rows_by_event
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.torque_columns import torque_structure
from identification.validation.held_out import (
    LeftOutParts,
    Second,
    condense_second,
    parts_of_seconds,
)

ASKED: Final[dict[FrictionTerm, str]] = {
    "offset": FRICTION_FUNCTIONS["offset"].symbol,
    "cubic": FRICTION_FUNCTIONS["cubic"].symbol,
    "load": "cl",
}
"""Candidate terms, with the symbols of their parameters."""
LEAST_GAIN: Final = 0.1
"""Smallest relative decrease of the RMS error on held-out data by a useful term."""
SIGMAS: Final = 2.0
FEWEST_SECONDS: Final = 10


def further_term_findings(
    robot: RobotDescription, signals: Sequence[SmoothedSignals], options: EstimationOptions
) -> tuple[str, ...]:
    """Name joints whose torque on held-out data is predicted better with a further friction term.

    A term counts if the squared error per second falls by more than two standard errors, and the
    RMS error by at least a tenth. Load-dependent friction must brake.

    Args:
        robot: The robot with the terms that were identified.
        signals: The recordings.
        options: The options of the estimate. If they contain friction terms instead of those of the
            robot file, no further terms are tried.
    """
    if not options.model.friction or options.model.friction_terms is not None:
        return ()
    asked: dict[str, list[str]] = {}
    try:
        trial = TermTrial.of(fit_smoothed(robot, [thin_rows(run) for run in signals], options))
        before = trial.equations.errors(trial.kept())
        for term in trial.terms:
            kept = trial.kept(term)
            after, values = trial.equations.errors(kept), trial.equations.values(kept)
            for j, joint in enumerate(robot.joints):
                place = trial.places.get((term, joint.name))
                if place is None or (term == "load" and values[place] <= 0.0):
                    continue
                if better := _decrease(before[:, j], after[:, j]):
                    asked.setdefault(joint.name, []).append(
                        f"{term} ({better[0]:.3g} to {better[1]:.3g})"
                    )
    except EstimationError:  # the recording is too short, or does not determine the terms
        return ()
    if not asked:
        return ()
    shown = "; ".join(
        f"{name}: {', '.join(asked[name])}" for name in robot.joint_names if name in asked
    )
    return (
        "Further friction terms predict held-out parts of the runs better than the terms of the"
        f" robot file. Joint, term, and RMS error [N m or N] without and with it: {shown}."
        " `rid-daq identify --choose` compares these terms and uses those that help.",
    )


def _decrease(before: FloatArray, after: FloatArray) -> tuple[float, float] | None:
    """Return a joint's RMS errors without and with a term; None if the term is not useful.

    Args:
        before, after: Shape (seconds,). Mean squared errors.
    """
    own = np.stack([before, after])
    own = own[:, np.isfinite(own.sum(axis=0))]
    if own.shape[1] < FEWEST_SECONDS:
        return None
    gain = own[0] - own[1]
    sure = gain.mean() > SIGMAS * np.std(gain, ddof=1) / math.sqrt(len(gain))
    first, last = np.sqrt(own.mean(axis=1)).tolist()
    return (first, last) if sure and last < (1.0 - LEAST_GAIN) * first else None


@dataclass(frozen=True, eq=False)
class TermTrial:
    """Condensed equations of a robot with all candidate terms.

    Attributes:
        terms: The candidate terms.
        equations: The equations.
        own: Shape (b,). Indices of the parameters of the robot without candidate terms.
        places: Index of the parameter of each candidate term and joint.
    """

    terms: tuple[FrictionTerm, ...]
    equations: LeftOutParts
    own: IntArray
    places: dict[tuple[FrictionTerm, str], int]

    def kept(self, term: FrictionTerm | None = None) -> IntArray:
        """Return the indices of the parameters of the robot with one candidate term, or none."""
        more = [place for (of, _), place in self.places.items() if of == term]
        return np.sort(np.append(self.own, np.array(more, dtype=np.int64)))

    @classmethod
    def of(cls, plain: FittedSignals) -> TermTrial:
        """Condense the equations of the recordings.

        Raises:
            EstimationError: The recordings have less than two parts, or every set of candidate
                terms changes the base parameters.
        """
        part = parts_of_seconds(plain)
        options = replace(plain.options, nonlinear=None)
        for terms in (tuple(ASKED), tuple(ASKED)[1:]):
            robot = _with_terms(plain.robot, terms)
            base = options.base_parameters(robot, plain.still)
            if set(plain.base.names) <= set(base.names):  # else an offset acts like gravity
                break
        else:
            raise EstimationError(
                "the candidate friction terms change the base parameters of the robot; choose the"
                " terms in the robot file",
                code="RID-MODEL-TERMS-DIFFER",
            )
        model, standard = _linearised(plain, options.build(robot))
        problem = replace(plain.problem, base=base)
        structure = torque_structure(model, base, slopes=True)
        width = len(base) + len(model.nonlinear_names)
        seconds = (
            condense_second(stretch, structure, width)
            for stretch in rows_by_event(problem.blocks(model, standard, low_passed=True))
        )
        names = (*base.names, *model.nonlinear_names)
        places: dict[tuple[FrictionTerm, str], int] = {}
        still = {each.joint for each in plain.still}
        moving = [joint for joint in plain.robot.joints if joint.name not in still]
        for term in terms:
            for joint in moving:
                name = f"{ASKED[term]}_{joint.name}"
                if term not in joint.friction and name in names:
                    places[term, joint.name] = names.index(name)
        own = np.array([names.index(name) for name in plain.base.names], dtype=np.int64)
        equations = LeftOutParts.of((Second(each, each) for each in seconds), part)
        return cls(terms, equations, own, places)


def _with_terms(robot: RobotDescription, terms: Sequence[FrictionTerm]) -> RobotDescription:
    """Return a robot whose joints have all of some friction terms."""
    joints = tuple(
        joint.model_copy(
            update={"friction": (*joint.friction, *(t for t in terms if t not in joint.friction))}
        )
        for joint in robot.joints
    )
    return robot.model_copy(update={"joints": joints})


def _linearised(plain: FittedSignals, model: RobotModel) -> tuple[RobotModel, FloatArray]:
    """Return the model at the estimate's nonlinear parameters, without further load friction.

    Also return the estimate's standard parameters, in the order of the model.
    """
    known = dict(zip(plain.model.nonlinear_names, plain.model.nonlinear_values, strict=True))
    model = model.with_nonlinear([known.get(name, 0.0) for name in model.nonlinear_names])
    fitted = plain.standard_values if plain.standard is None else plain.standard
    values = dict(zip(plain.model.parameter_names, fitted, strict=True))
    return model, np.array([values.get(name, 0.0) for name in model.parameter_names])
