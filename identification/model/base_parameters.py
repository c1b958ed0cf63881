"""`BaseParameters`: the identifiable combinations of a robot's parameters, as text and matrix.

Not every standard parameter affects the torques. The base parameters are found by a rank-revealing
QR factorisation of the regressor stacked over random samples (theory: section 2). Columns are
processed in an order that keeps readable parameters, and a column that depends on the kept ones is
merged into them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import qr, solve_triangular

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor
from dynamics.model.transmission import Transmission
from dynamics.terms.conditions import Conditions
from identification.model.still_joints import StillJoint
from identification.regression.least_squares import triangular_factor

ModelKind = Literal["internal", "external", "combined"]
"""Measured quantities: joint torques, the base wrench, or both (4.1-4.3)."""

_RIGID = re.compile(r"(m|s[xyz]|I[xyz]{2})(\d+|L)")
# Order in which a link's columns are kept; its Iyy, sz and m come last (Khalil's choice).
_KEEP_ORDER = ("Izz", "Ixx", "Ixy", "Ixz", "Iyz", "sx", "sy", "Iyy", "sz", "m")
_ROUNDING = 1e-10
_SAMPLES = 300
_LOSS = 0.1


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The linear combinations of standard parameters that can be identified.

    Attributes:
        names: Length b. The first standard parameter (head) of each combination.
        expressions: Length b. Each combination in full, such as "Izz1 + Iyy2 + 0.2304 m3".
        units: Length b. Unit of each base parameter (that of its head).
        standard_names: Length p. The model's parameters, in its order.
        kept: Length b. Index of each head among the standard parameters.
        combination: Shape (b, p). Matrix K of beta = K theta.
        unseen: Standard parameters without any effect.
    """

    names: tuple[str, ...]
    expressions: tuple[str, ...]
    units: tuple[str, ...]
    standard_names: tuple[str, ...]
    kept: tuple[int, ...]
    combination: FloatArray
    unseen: tuple[str, ...]

    def __post_init__(self) -> None:
        shape = (len(self.kept), len(self.standard_names))
        freeze(self, EstimationError, shape, "combination")
        if not len(self.names) == len(self.expressions) == len(self.units) == len(self.kept):
            raise EstimationError(
                f"base parameters: {len(self.names)} names, {len(self.expressions)} expressions"
                f" and {len(self.units)} units were given for {len(self.kept)} parameters",
                code="RID-API-ARGUMENT",
            )

    def __len__(self) -> int:
        return len(self.kept)

    @property
    def rigid_body(self) -> tuple[bool, ...]:
        """For each base parameter: True if its head is a link's mass, moment or inertia."""
        return tuple(_RIGID.fullmatch(name) is not None for name in self.names)

    def columns(self, standard_regressor: FloatArray) -> FloatArray:
        """Return the base regressor (..., b) of a standard regressor (..., p)."""
        return standard_regressor.take(self.kept, axis=-1)

    def to_standard(self, values: FloatArray) -> FloatArray:
        """Return standard parameters (p,) with the same torques; those not in `kept` are zero."""
        standard = np.zeros(len(self.standard_names))
        standard[list(self.kept)] = values
        return standard

    def from_standard(self, parameters: FloatArray) -> FloatArray:
        """Return beta = K theta, shape (b,), of standard parameters of shape (p,)."""
        theta = np.asarray(parameters, dtype=float)
        if theta.shape != (len(self.standard_names),):
            raise EstimationError(
                f"an array of shape {theta.shape} was given, but {len(self.standard_names)}"
                f" standard parameters are required ({', '.join(self.standard_names)})",
                code="RID-API-ARGUMENT",
            )
        return np.asarray(self.combination @ theta)


def base_parameters(
    model: RobotModel,
    *,
    kind: ModelKind = "internal",
    still: Sequence[StillJoint] = (),
    lossy: Sequence[int] = (),
    seed: int = 0,
) -> BaseParameters:
    """Find the base parameters of a robot model, from random samples with large excitation.

    Args:
        model: The robot.
        kind: Measured quantities: joint torques (the internal model), the six components of the
            base wrench (external), or both. If the model contains a payload, half of the samples
            are with the payload and half are without it.
        still: Joints at rest, with their positions. Their torques count as not measured, because
            friction at standstill can have any value.
        lossy: Joints whose gears have a loss of any size; all other gears count as lossless. The
            loss separates the inertia of the joint's own rotor, whose torque its gear does not
            transmit, from that of the links.
        seed: Seed of the samples. The positions of all other joints are in -pi..pi [rad or m], so
            that the result is a property of the structure and not of one motion.

    Raises:
        EstimationError: No joint moves, no parameter has an effect, or the rank is ambiguous.
    """
    stacked = random_regressor(model, kind=kind, still=still, lossy=lossy, seed=seed)
    return independent_columns(stacked, model.parameter_names, model.parameter_units)


def random_regressor(
    model: RobotModel,
    *,
    kind: ModelKind = "internal",
    still: Sequence[StillJoint] = (),
    lossy: Sequence[int] = (),
    seed: int = 0,
) -> FloatArray:
    """Return the regressor for `base_parameters`, shape (rows, p)."""
    random = np.random.default_rng(seed)
    shape = (_SAMPLES, len(model.joint_names))
    q = random.uniform(-np.pi, np.pi, shape)
    v, a = random.normal(0.0, 2.0, shape), random.normal(0.0, 5.0, shape)
    for each in still:
        j = model.joint_names.index(each.joint)
        q[:, j], v[:, j], a[:, j] = random.choice(each.positions, _SAMPLES), 0.0, 0.0
    measured = np.any(model.actuator_speed(v) != 0.0, axis=0)
    if not measured.any():
        raise EstimationError(
            "no joint moves in the runs: record a motion that moves the joints",
            code="RID-MOTION-UNINFORMATIVE",
        )
    losses = tuple(each.of_size(_LOSS) for each in model.transmission.losses if each.joint in lossy)
    model = replace(model, transmission=Transmission(losses))
    temperature = random.uniform(280.0, 350.0, shape)
    load = random.normal(size=shape) if losses else None
    parts: list[FloatArray] = []
    for payload in (False, True) if "payload" in model.parameter_groups else (False,):
        conditions = Conditions(temperature_k=temperature, load_nm=load, payload=payload)
        if kind != "external":
            parts.append(regressor(model, q, v, a, conditions)[:, measured])
        if kind != "internal":
            parts.append(base_wrench_regressor(model, q, v, a, conditions))
    columns = len(model.parameter_names)
    return np.vstack([part.reshape(-1, columns) for part in parts])


def independent_columns(
    stacked: FloatArray, names: tuple[str, ...], units: tuple[str, ...], tolerance: float = 1e-8
) -> BaseParameters:
    """Find the base parameters of a stacked regressor of shape (rows, p).

    A column counts as dependent if its part that is independent of the kept columns is smaller than
    the fraction `tolerance` of the column.
    """
    size = np.linalg.norm(stacked, axis=0)
    seen = size > 1e-12 * size.max(initial=0.0)
    if not seen.any():
        raise EstimationError(
            "no parameter of the model has an effect in this motion: record a motion that moves"
            " the joints",
            code="RID-MOTION-UNINFORMATIVE",
        )
    order = [j for j in sorted(range(len(names)), key=lambda j: _priority(names[j])) if seen[j]]
    triangle = triangular_factor(stacked[:, order] / size[order])
    kept = _independent_in_order(triangle, tolerance)
    _check_rank(triangle, len(kept), tolerance)

    # Sort the heads in the model's order.
    heads = sorted(order[k] for k in kept)
    merged = [j for j in order if j not in heads]
    position = {j: place for place, j in enumerate(order)}
    basis, upper = np.linalg.qr(triangle[:, [position[j] for j in heads]])
    scaled = solve_triangular(upper, basis.T @ triangle[:, [position[j] for j in merged]])
    combination = np.zeros((len(heads), len(names)))
    combination[range(len(heads)), heads] = 1.0
    scaled[np.abs(scaled) < _ROUNDING] = 0.0
    combination[:, merged] = scaled * size[merged] / size[heads][:, np.newaxis]
    return BaseParameters(
        names=tuple(names[j] for j in heads),
        expressions=tuple(
            _expression(row, names, j) for row, j in zip(combination, heads, strict=True)
        ),
        units=tuple(units[j] for j in heads),
        standard_names=names,
        kept=tuple(heads),
        combination=combination,
        unseen=tuple(name for name, known in zip(names, seen, strict=True) if not known),
    )


def joints_with_separate_rotors(model: RobotModel, base: BaseParameters) -> tuple[int, ...]:
    """Return the joints with lossy gears whose rotor's inertia is a base parameter."""
    lossy = [loss.joint for loss in model.transmission.losses]
    return tuple(j for j in lossy if not rotor_names(j).isdisjoint(base.names))


def rotor_names(joint: int) -> set[str]:
    """Return the possible names of the inertia of a joint's rotor."""
    return {f"Ia{joint + 1}", f"Im{joint + 1}"}


def _priority(name: str) -> tuple[int, int, int]:
    """Return a sort key: friction and spring, then rigid bodies by `_KEEP_ORDER`, then rotors."""
    rigid = _RIGID.fullmatch(name)
    if rigid is not None:
        link = 0 if rigid[2] == "L" else int(rigid[2])
        return (1, _KEEP_ORDER.index(rigid[1]), link)
    return (2, 0, 0) if name.startswith(("Im", "Ia")) else (0, 0, 0)


def _independent_in_order(triangle: FloatArray, tolerance: float) -> list[int]:
    """Return the columns (of unit norm) that are independent of all previously kept ones."""
    basis = np.zeros((len(triangle), 0))
    kept: list[int] = []
    for j in range(triangle.shape[1]):
        rest = triangle[:, j]
        for _ in range(2):  # the second pass removes the rounding error of the first
            rest = rest - basis @ (basis.T @ rest)
        length = float(np.linalg.norm(rest))
        if length > tolerance:
            basis = np.column_stack([basis, rest / length])
            kept.append(j)
    return kept


def _check_rank(triangle: FloatArray, rank: int, tolerance: float) -> None:
    """Compare the rank with column-pivoted QR, whose diagonal must have a gap."""
    diagonal = np.abs(np.diagonal(qr(triangle, mode="r", pivoting=True)[0]))
    pivoted = int(np.count_nonzero(diagonal > tolerance))
    if pivoted != rank:
        raise EstimationError(
            f"the number of base parameters is ambiguous at the tolerance {tolerance:g}: {rank}"
            f" columns are independent one by one, but {pivoted} by pivoted QR. Nearly parallel"
            " axes cause this: correct the axes in the robot file, or pass a `tolerance` clearly"
            " above or below the small pivots"
            f" {', '.join(f'{d:.1e}' for d in diagonal[min(rank, pivoted) - 1 :][:4])}",
            code="RID-MODEL-RANK",
        )


def _expression(row: FloatArray, names: tuple[str, ...], head: int) -> str:
    """Return one combination as text: its head first, then the rest in the model's order."""
    text = names[head]
    for j in np.flatnonzero(row):
        if j == head:
            continue
        coefficient = float(
            f"{float(f'{row[j]:.10g}'):.5g}"
        )  # round to 10 digits first, for reproducible rounding of ties
        factor = "" if abs(coefficient) == 1.0 else f"{_five_digits(abs(coefficient))} "
        text += f" {'-' if coefficient < 0.0 else '+'} {factor}{names[j]}"
    return text


def _five_digits(value: float) -> str:
    """Return a number with five significant digits, without an exponent if this is short."""
    return f"{value:.0f}" if 1e4 <= value < 1e7 else f"{value:.5g}"
