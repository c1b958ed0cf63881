"""Mistakes that `benchmarks.mistakes` injects into the description of a force plate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from benchmarks.sound_plates import WeighedArm, weighed_arms
from config.arrays import FloatArray
from config.cell.plate import CHANNEL_NAMES, CHANNELS, PlateConfig
from identification.calibration.plate_equations import PlateEquations
from identification.calibration.plate_hypotheses import wrench_matrix
from identification.calibration.plate_mistake import PlateKind
from identification.calibration.plate_search import best_mistake
from identification.estimation.fitted_periods import unsolved_equations
from identification.estimation.options import EstimationOptions
from identification.model.drawn_arm import drawn_parameters, plausible_weight
from identification.model.options import ModelOptions

SOUND: Final = "sound"
SHIFTS_M: Final = (0.05, 0.1, 0.3)
YAWS_DEG: Final = (5.0, 20.0, 90.0, 180.0)
FACTORS: Final = (1.2, 0.8, -1.0, 10.0)
VISIBLE_TIMES: Final = 2.0
VISIBLE_GAIN: Final = 0.2
EXTERNAL: Final = EstimationOptions(model=ModelOptions(kind="external"))


@dataclass(frozen=True, eq=False)
class InjectedPlateMistake:
    """An injected mistake.

    Attributes:
        name: Description of the change.
        kinds: Kinds of mistake that count as a correct diagnosis.
        plate: The wrong description.
        channels: Shape (8, 8). Matrix that maps the real channels to the recorded ones.
        of_all: True if all channels have the mistake; then only the arm's weight reveals the
            mistake.
    """

    name: str
    kinds: tuple[PlateKind, ...]
    plate: PlateConfig
    channels: FloatArray = field(default_factory=lambda: np.eye(CHANNELS))
    of_all: bool = False


@dataclass(frozen=True, eq=False)
class PlateOutcome:
    """Result for one injected mistake.

    Attributes:
        arm, name: Robot and mistake.
        named: True if the search for mistakes named the mistake's kind.
        refused: True if the fit of a wrench component is bad.
        visible: True if the mistake has an effect on the data.
    """

    arm: str
    name: str
    named: bool
    refused: bool
    visible: bool


def plate_outcomes(count: int, first_seed: int) -> Iterator[PlateOutcome]:
    """Yield results for `count` arms, with every mistake and with the correct description."""
    for arm in weighed_arms(count, first_seed):
        equations, drawn = _condense(arm)
        plausible = plausible_weight(arm.robot)
        truth = equations.shares(wrench_matrix(arm.plate))
        name = arm.robot.name
        found = best_mistake(equations, arm.plate, drawn, plausible)
        yield PlateOutcome(name, SOUND, found is not None, False, False)
        for made in _mistakes(arm.plate):
            own = replace(
                equations,
                crossed=equations.crossed @ made.channels.T,
                channels=made.channels @ equations.channels @ made.channels.T,
            )
            found = best_mistake(own, made.plate, drawn, plausible)
            stated = own.shares(wrench_matrix(made.plate))
            named = found is not None and found.kind in made.kinds
            visible = made.of_all or _far_better(truth, stated)
            yield PlateOutcome(name, made.name, named, bool(np.any(stated > 0.3)), visible)


def _condense(arm: WeighedArm) -> tuple[PlateEquations, FloatArray]:
    """Return the equations of an arm's wrench, and the parameters from its CAD data."""
    equations, model, base = unsolved_equations(arm.robot, [arm.average], EXTERNAL)
    condensed = PlateEquations.of([arm.average], equations, [0.0])
    assert condensed is not None
    return condensed, base.from_standard(drawn_parameters(model, arm.robot))


def _far_better(truth: FloatArray, stated: FloatArray) -> bool:
    """Return True if the true description halves a residual and clearly lowers their product."""
    times = stated / truth
    return bool(np.any(times >= VISIBLE_TIMES)) and float(np.sum(np.log(times))) >= VISIBLE_GAIN


def _mistakes(plate: PlateConfig) -> Iterator[InjectedPlateMistake]:
    """Yield plates, each with one mistake in its description or in its channels."""

    def stated(name: str, *kinds: PlateKind, **changes: object) -> InjectedPlateMistake:
        return InjectedPlateMistake(name, kinds, plate.model_copy(update=changes))

    size, place, turn = PlateKind.SIZE, PlateKind.POSITION, PlateKind.ROTATION
    yield stated("a_m a fifth too large", size, a_m=1.2 * plate.a_m)
    yield stated("b_m a quarter too small", size, b_m=0.75 * plate.b_m)
    yield stated("a_m and b_m swapped", size, a_m=plate.b_m, b_m=plate.a_m)
    for deeper in (0.03, 0.1):  # az0 and the height of the position cannot be distinguished
        name = f"az0_m {deeper:g} m too low"
        yield stated(name, size, place, az0_m=plate.az0_m - deeper)
    for axis, shift in ((axis, shift) for axis in range(3) for shift in SHIFTS_M):
        moved = list(plate.position_m)
        moved[axis] += shift
        kinds = (place, size) if axis == 2 else (place,)
        name = f"position off by {shift:g} m along {'xyz'[axis]}"
        yield stated(name, *kinds, position_m=tuple(moved))
    roll, pitch, yaw = plate.rotation_rad
    for degrees in YAWS_DEG:
        rotation = (roll, pitch, yaw + math.radians(degrees))
        yield stated(f"turned by {degrees:g} degrees", turn, rotation_rad=rotation)
    yield stated("upside down", turn, rotation_rad=(0.0, pitch, yaw))
    yield stated("upside down and turned", turn, rotation_rad=(0.0, pitch, yaw + 0.5))
    yield from _of_channels(plate)


def _of_channels(plate: PlateConfig) -> Iterator[InjectedPlateMistake]:
    sensitivity, order = (PlateKind.SENSITIVITY,), (PlateKind.ORDER,)

    def scaled(name: str, channels: tuple[int, ...], factor: float) -> InjectedPlateMistake:
        scale = np.ones(CHANNELS)
        scale[list(channels)] = factor
        of_all = len(channels) == CHANNELS
        return InjectedPlateMistake(name, sensitivity, plate, np.diag(scale), of_all)

    for channel, factor in ((channel, f) for channel in range(CHANNELS) for f in FACTORS):
        yield scaled(f"{CHANNEL_NAMES[channel]} times {factor:g}", (channel,), factor)
    every = tuple(range(CHANNELS))
    for name, channels in (
        ("along x", (0, 1)),
        ("horizontal", (0, 1, 2, 3)),
        ("vertical", (4, 5, 6, 7)),
        ("fx12, fz3", (0, 6)),
    ):
        yield scaled(f"{name} reversed", channels, -1.0)
    yield scaled("vertical times 2", every[4:], 2.0)
    yield scaled("all reversed", every, -1.0)
    yield scaled("all in kN", every, 1e-3)
    for name, own in (
        ("fx12, fx34 swapped", (1, 0, 2, 3, 4, 5, 6, 7)),
        ("fy14, fy23 swapped", (0, 1, 3, 2, 4, 5, 6, 7)),
        ("fz1, fz2 swapped", (0, 1, 2, 3, 5, 4, 6, 7)),
        ("x and y swapped", (2, 3, 0, 1, 4, 5, 6, 7)),
        ("vertical channels in reverse order", (0, 1, 2, 3, 7, 6, 5, 4)),
        ("vertical channels shifted by one", (0, 1, 2, 3, 5, 6, 7, 4)),
        ("all channels in reverse order", every[::-1]),
        ("all channels shifted by one", (*every[1:], 0)),
        ("vertical before horizontal", (*every[4:], *every[:4])),
        ("three in a cycle", (0, 4, 2, 1, 3, 5, 6, 7)),
    ):
        yield InjectedPlateMistake(f"channels: {name}", order, plate, np.eye(CHANNELS)[list(own)])
