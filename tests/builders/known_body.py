"""Known bodies of the bundled three-axis arm, with a fraction of a link's true parameters."""

from __future__ import annotations

import numpy as np

from config.load import load_cell
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.payload.body import PayloadBody


def link_parameters(link: int) -> tuple[str, ...]:
    """Return the names of the ten rigid-body parameters of a link, counted from 1."""
    symbols = ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    return tuple(f"{symbol}{link}" for symbol in symbols)


def bodies_text(
    name: str, of_link: int, share: float, *, on_link: int | None = None, mass_sigma_kg: float = 0.0
) -> str:
    """Return the YAML text of the key `bodies` with one body.

    Args:
        name: Name of the body.
        of_link: Link whose parameters the body has, multiplied by `share`.
        share: Fraction of these parameters.
        on_link: Link that carries the body; `of_link` by default.
        mass_sigma_kg: Standard deviation of the mass.
    """
    cell = load_cell("ir361")
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    values = np.array(true_parameters(model, cell.robot, cell.plant))
    at = [model.parameter_names.index(each) for each in link_parameters(of_link)]
    mass, x, y, z, *inertia = PayloadBody.of_parameters(share * values[at]).reported
    return (
        f"bodies:\n  {name}: {{link: {on_link or of_link}, mass_kg: {mass:.12g},"
        f" mass_sigma_kg: {mass_sigma_kg}, centre_m: {[float(x), float(y), float(z)]},"
        f" inertia_kg_m2: {[float(each) for each in inertia]}}}\n"
    )
