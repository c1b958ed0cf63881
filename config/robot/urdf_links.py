"""Drawing data of moving links from a URDF, repaired or guessed if necessary.

An inertia that is physically impossible is replaced by the nearest possible one. A link without a
plausible mass becomes a cylinder that is marked as a guess.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from config.arrays import FloatArray
from config.formats.urdf import UrdfInertial, UrdfLink, UrdfTree
from config.robot.axis_lines import AxisPoses
from config.robot.link_cad import LinkCad
from config.robot.nominal_links import nominal_links

PLACEHOLDER_GYRATION_M: Final = 0.002
LARGEST_GYRATION_M: Final = 5.0
TOO_HEAVY: Final = 20.0
MASSES_KG: Final = (1e-4, 3e3)
FLATTEST: Final = 1e-4
ROUNDING: Final = 1e-7
_FROM_MOMENTS: Final = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]])


@dataclass(frozen=True)
class UrdfLinks:
    """Drawing data of the moving links, notes on all links, and comments by link (from 0)."""

    cad: tuple[LinkCad, ...]
    notes: tuple[str, ...]
    comments: dict[int, str]


@dataclass(frozen=True, eq=False)
class _Part:
    """A rigid part: mass, centre (3,), inertia about the centre (3, 3), in the link's frame."""

    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray


def links_of_urdf(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisPoses,
    tool_m: FloatArray,
) -> UrdfLinks:
    """Return mass, centre and inertia of every moving link in its frame.

    Args:
        tree: The URDF.
        carried: The URDF's links that move together: with the base, then with each joint.
        places: Pose (4, 4) of each of the URDF's links in the base, with the arm's joints at zero.
        axes: The robot's frames.
        tool_m: Shape (3,). Tool point in the last frame [m].
    """
    rows = [[r.alpha_rad, r.beta_rad, r.theta_rad, r.a_m, r.d_m] for r in axes.rows]
    guesses = nominal_links(np.array(rows), tool_m)
    notes = [
        _with_link_name(tree.links[name], words)
        for name in carried[0]
        for words in tree.links[name].oddities
    ]
    cad: list[LinkCad] = []
    comments: dict[int, str] = {}
    guessed: list[str] = []
    for number, names in enumerate(carried[1:]):
        remarks: list[str] = []
        change = 0.0
        parts: list[_Part] = []
        for link in (tree.links[name] for name in names):
            remarks += [_with_link_name(link, words) for words in link.oddities]
            if link.inertial is None or link.inertial.mass_kg == 0.0:
                continue
            inertia, changed, words = _repair_inertia(link, link.inertial)
            change = max(change, changed)
            remarks += words
            place = np.linalg.inv(axes.frames[number + 1]) @ places[link.name]
            place = place @ link.inertial.placement
            turn = place[:3, :3]
            parts.append(_Part(link.inertial.mass_kg, place[:3, 3], turn @ inertia @ turn.T))
        whole = _merge(parts)
        if whole is None or not MASSES_KG[0] <= whole.mass_kg <= MASSES_KG[1]:
            cad.append(guesses[number])
            stated = f"{whole.mass_kg:g} kg" if whole is not None else "no mass"
            comments[number] = (
                f"a guess, because the URDF states {stated}: a cylinder of"
                f" {guesses[number].mass_kg:.3g} kg; not used as a prior"
            )
            guessed.append(f"{', '.join(names)} ({stated}; {guesses[number].mass_kg:.3g} kg)")
        else:
            cad.append(_drawing(whole, change))
            unknown = cad[-1].unknown_inertia_kg_m2
            if unknown:
                remarks.append(
                    f"link {number + 1} ({', '.join(names)}) has {whole.mass_kg:.4g} kg and almost"
                    " no inertia (zero, or rounded away); --cad-prior treats it as unknown,"
                    f" 0 ± {unknown:.2g} kg m²"
                )
        notes += remarks
        if remarks:
            comments[number] = "; ".join((*remarks, *filter(None, [comments.get(number)])))
    notes += _warn_of_grams(cad, carried[1:])
    if guessed:
        notes.append(
            "these links have no plausible mass and are simulated as cylinders along the arm, which"
            f" are not used as a prior: {'; '.join(guessed)}. If you know their masses, state them"
            " under `cad` in robot.yaml"
        )
    return UrdfLinks(tuple(cad), tuple(notes), comments)


def _warn_of_grams(cad: Sequence[LinkCad], names: Sequence[list[str]]) -> list[str]:
    """Warn about a link that is many times as heavy as all others together."""
    masses = [link.mass_kg for link in cad]
    return [
        f"link {number} ({', '.join(names[number - 1])}) has {mass:.4g} kg, all others together"
        f" {sum(masses) - mass:.3g} kg: is its mass in grams? If so, correct it in the URDF,"
        " because torques and speeds of the simulated robot depend on it"
        for number, mass in enumerate(masses, start=1)
        if len(masses) > 2 and mass > TOO_HEAVY * (sum(masses) - mass)
    ]


def _merge(parts: list[_Part]) -> _Part | None:
    """Return several parts as one body; None if there are no parts."""
    if not parts:
        return None
    mass = sum(part.mass_kg for part in parts)
    centre = np.sum([part.mass_kg * part.centre_m for part in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.centre_m - centre
        inertia += part.inertia_kg_m2 + part.mass_kg * (r @ r * np.eye(3) - np.outer(r, r))
    return _Part(mass, centre, inertia)


def _repair_inertia(link: UrdfLink, inertial: UrdfInertial) -> tuple[FloatArray, float, list[str]]:
    """Return a possible inertia (3, 3) for a link, its relative change, and notes.

    The principal moments become the nearest ones (least squares) of a body that is not quite flat:
    none is negative, none is larger than the sum of the other two.
    """
    stated = inertial.inertia_kg_m2
    moments, directions = np.linalg.eigh(stated)
    gyration_m = float(np.sqrt(np.abs(moments).sum() / (2.0 * inertial.mass_kg)))
    if gyration_m < PLACEHOLDER_GYRATION_M:
        return np.zeros((3, 3)), 0.0, []
    if gyration_m > LARGEST_GYRATION_M:
        words = (
            f"the inertia of {link.name!r} ({link.where}) is that of {inertial.mass_kg:g} kg"
            f" {gyration_m:.3g} m from the centre (a unit other than kg m²?); it counts as unknown"
        )
        return np.zeros((3, 3)), 0.0, [words]
    if moments[0] >= 0.0 and moments[0] + moments[1] >= moments[2] * (1.0 - ROUNDING):
        return stated, 0.0, []
    spread, _ = nnls(_FROM_MOMENTS, moments)
    spread = np.maximum(spread, FLATTEST * spread.max())
    possible = _FROM_MOMENTS @ spread
    change = float(np.linalg.norm(possible - moments) / np.linalg.norm(moments))
    words = (
        f"the inertia of {link.name!r} ({link.where}) is physically impossible, principal moments"
        f" {_list_moments(moments)} kg m²; the nearest possible one, {_list_moments(possible)},"
        f" was used ({100.0 * change:.2g} % changed)"
    )
    repaired = directions @ np.diag(possible) @ directions.T
    return repaired, change, [words]


def _drawing(body: _Part, change: float) -> LinkCad:
    """Return a link's drawing data, with larger uncertainty if its inertia was changed a lot."""
    upper = body.inertia_kg_m2[np.triu_indices(3)]
    usual = LinkCad.model_fields["uncertainty"].default
    x, y, z = (round(value, 15) + 0.0 for value in body.centre_m.tolist())
    return LinkCad(
        mass_kg=body.mass_kg,
        centre_m=(x, y, z),
        inertia_kg_m2=tuple(round(value, 15) + 0.0 for value in upper.tolist()),
        uncertainty=max(usual, round(min(change, 1.0), 3)),
    )


def _with_link_name(link: UrdfLink, words: str) -> str:
    return f"{link.name}: {words}"


def _list_moments(moments: FloatArray) -> str:
    return ", ".join(f"{moment:.4g}" for moment in moments)
