"""A mass of a prismatic joint that differs from `cad` is mentioned, although it is possible."""

from __future__ import annotations

import pytest

from identification.wiring.moved_mass import MovedMass
from rid_daq.report.mistake_entry import MovedMassEntry


@pytest.mark.parametrize(
    ("drawn", "has_rotor", "is_mentioned"),
    [
        (0.5, True, True),
        (0.5, False, True),
        (2.0, False, True),
        (2.0, True, False),
        (1.1, False, False),
        (0.9, True, False),
    ],
)
def test_a_mass_that_differs_from_cad_is_mentioned_unless_a_rotor_can_be_the_reason(
    drawn: float, has_rotor: bool, is_mentioned: bool
) -> None:
    moved = MovedMass(
        joint="x",
        mass_kg=100.0 * drawn,
        sigma_kg=1.0,
        held=None,
        held_sigma=None,
        drawn=drawn,
        drawn_sigma=0.01,
        plausible=(0.3, float("inf") if has_rotor else 3.0),
        hidden=False,
        has_rotor=has_rotor,
    )
    assert moved.is_plausible
    assert MovedMassEntry.of(moved).differs is is_mentioned
