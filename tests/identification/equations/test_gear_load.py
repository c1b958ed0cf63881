"""The load of gears: without the torque of their own rotors, also if only friction shows it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.processing.unfiltered import smooth_gaussian
from benchmarks.honest_choice import BAND_HZ, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, drive
from config.arrays import FloatArray
from identification.equations.block_grams import PLAIN, Grams, Terms
from identification.equations.candidate_equations import CandidateEquations
from identification.equations.gear_load import with_gear_load
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import base_parameters
from identification.model.drawn_arm import drawn_parameters

BLOCK_S = 1.0
DURATION_S = 20.0
LOADED: Terms = (*PLAIN, "load")


@cache
def equations(friction: str) -> CandidateEquations:
    robot = ARMS["three"].description()
    options = EstimationOptions()
    driven = drive("three", "sines", 5, FRICTIONS[friction], DURATION_S)
    run, _ = recording(Case("three", friction, "none", 5), driven, 0, robot)
    plain = replace(options.model, friction=False, friction_terms=None, nonlinear=None)
    model = plain.build(robot)
    signals = [smooth_nonperiodic(run, BAND_HZ)]
    return CandidateEquations.of(model, base_parameters(model), signals, options.standstill_rad_s)


def load_nm(friction: str, terms: Terms) -> FloatArray:
    """Return the load of each gear that a fit with the terms gives, (rows, n)."""
    plain, channel = equations(friction), TorqueChannel.none(3)
    loaded = plain
    for chosen in (PLAIN, terms, terms):
        grams = Grams.of(loaded, channel, BLOCK_S)
        loaded = with_gear_load(loaded, grams, [chosen] * 3, channel, BLOCK_S)
    return loaded.pieces[0].load_nm


def true_load_nm(friction: str) -> FloatArray:
    own = equations(friction)
    links = drawn_parameters(own.model, ARMS["three"].description())
    return smooth_load_nm(own, own.base.from_standard(links))


def smooth_load_nm(own: CandidateEquations, values: FloatArray) -> FloatArray:
    """Return the torque of base parameters, smoothed like the load in a fit, (rows, n)."""
    piece = own.pieces[0]
    return smooth_gaussian(piece.rigid @ values, piece.step_s, piece.load_width_s)


def errors(found_nm: FloatArray, true_nm: FloatArray) -> FloatArray:
    """Return each joint's RMS error, divided by the RMS of its load."""
    return np.asarray(np.sqrt(np.mean((found_nm - true_nm) ** 2, 0) / np.mean(true_nm**2, 0)))


def test_load_dependent_friction_shows_the_rotors_that_other_torques_do_not_separate() -> None:
    found = errors(load_nm("load", LOADED), true_load_nm("load"))
    np.testing.assert_array_less(found, 0.1)


@pytest.mark.parametrize(("friction", "terms"), [("load", PLAIN), ("plain", LOADED)])
def test_without_such_friction_these_rotors_count_as_part_of_the_links(
    friction: str, terms: Terms
) -> None:
    arm, own = ARMS["three"], equations(friction)
    inertia = own.base.from_standard(
        np.array([arm.rotor[int(name[2:]) - 1] if name in ("Ia1", "Ia2") else 0.0
                  for name in own.base.standard_names])
    )  # fmt: skip
    lumped_nm = true_load_nm(friction) + smooth_load_nm(own, inertia)
    np.testing.assert_array_less(errors(load_nm(friction, terms), lumped_nm), 0.1)
