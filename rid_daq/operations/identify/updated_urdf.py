"""`UpdatedUrdfSection`: changes of a user's URDF as numbers, and as tables for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Final, Self

import numpy as np
from pydantic import Strict

from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.export.urdf_update import UpdatedUrdf
from rid_daq.blocks.block import AnyBlock, Cells, Heading, Interval, Text, note_blocks, table
from rid_daq.blocks.formats import unit
from rid_daq.report.sections.section import Section, Texts

ROUNDING: Final = 1e-12


class UpdatedLink(Section):
    """A link with a new `<inertial>`.

    Attributes:
        name: The link.
        mass_before_kg: Mass in the URDF as it was; null if it stated none.
        mass_kg, centre_m: Written mass, and centre of gravity in the link's frame.
        inertia_kg_m2: Written ixx, ixy, ixz, iyy, iyz, izz about the centre of gravity, in the axes
            of the link.
        unchanged_links: Links fixed to this link, which keep their values.
    """

    name: str
    mass_before_kg: float | None
    mass_kg: float
    centre_m: Annotated[tuple[float, ...], Strict(False)]
    inertia_kg_m2: Annotated[tuple[float, ...], Strict(False)]
    unchanged_links: Texts


class UpdatedJoint(Section):
    """A joint with a new `<dynamics>`; null for values that were not stated.

    Attributes:
        name: The joint.
        damping_before, damping: Viscous friction before and now [N m s/rad or N s/m].
        friction_before, friction: Coulomb friction before and now [N m or N].
    """

    name: str
    damping_before: float | None
    damping: float
    friction_before: float | None
    friction: float


class MeasuredCombination(Section):
    """An identified combination of inertial parameters, in the frames of the model.

    Attributes:
        expression: The combination.
        unit: Unit of the values.
        before: Its value in the URDF as it was; null if it contains more than links' inertias.
        value, std: The identified value and its standard deviation.
        written: Its value in the updated URDF, with the identified rotors.
    """

    expression: str
    unit: str
    before: float | None
    value: float
    std: float
    written: float


class UpdatedUrdfSection(Section):
    """Changes of a user's URDF.

    Attributes:
        links, joints: The arm's links and joints.
        combinations: The combinations that the recordings determine; all other directions of the
            inertial parameters keep the values of the URDF if physical consistency allows it.
        notes: What a URDF cannot express, and what was not measured or not changed.
    """

    links: Annotated[tuple[UpdatedLink, ...], Strict(False)]
    joints: Annotated[tuple[UpdatedJoint, ...], Strict(False)]
    combinations: Annotated[tuple[MeasuredCombination, ...], Strict(False)]
    notes: Texts

    @classmethod
    def of(cls, estimate: Estimate, model: ExportModel, updated: UpdatedUrdf) -> Self:
        """Return the changes that were written for a model."""
        links = tuple(
            UpdatedLink(
                name=each.name,
                mass_before_kg=each.before_kg,
                mass_kg=each.body.mass_kg,
                centre_m=tuple(each.body.centre_m.tolist()),
                inertia_kg_m2=tuple(each.body.inertia_kg_m2[np.triu_indices(3)].tolist()),
                unchanged_links=each.unchanged_links,
            )
            for each in updated.links
        )
        return cls(
            links=links,
            joints=tuple(UpdatedJoint.from_attributes(each) for each in updated.joints),
            combinations=_combinations(estimate, model, updated),
            notes=updated.notes,
        )

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the tables of links, measured combinations and joints, and the notes."""
        yield Heading(text="Links")
        yield table(
            self.links,
            Cells("link", lambda each: each.name),
            Cells("mass before", lambda each: each.mass_before_kg, "kg"),
            Cells("mass", lambda each: each.mass_kg, "kg"),
            Cells("x", lambda each: each.centre_m[0], "m", is_optional=True),
            Cells("y", lambda each: each.centre_m[1], "m", is_optional=True),
            Cells("z", lambda each: each.centre_m[2], "m", is_optional=True),
        )
        yield Text(
            text="Masses and centres are those of the URDF, changed as little as the measured"
            " combinations below require.",
            is_note=True,
        )
        yield Heading(text="Measured combinations")
        yield table(
            self.combinations,
            Cells("combination", lambda each: each.expression),
            Cells("URDF before", lambda each: each.before),
            Cells("measured ± 2σ", lambda each: Interval.of(each.value, each.std)),
            Cells("written", lambda each: each.written),
            Cells("unit", lambda each: unit(each.unit)),
        )
        yield Text(
            text="Frames of the model: z along the joint's axis. The recordings determine"
            " these combinations and nothing else about the links.",
            is_note=True,
        )
        yield Heading(text="Joints")
        yield table(
            self.joints,
            Cells("joint", lambda each: each.name),
            Cells("damping before", lambda each: each.damping_before),
            Cells("damping", lambda each: each.damping),
            Cells("friction before", lambda each: each.friction_before),
            Cells("friction", lambda each: each.friction),
        )
        yield from note_blocks(list(self.notes))


def _combinations(
    estimate: Estimate, model: ExportModel, updated: UpdatedUrdf
) -> tuple[MeasuredCombination, ...]:
    base = estimate.base
    links = PARAMETERS_PER_LINK * model.model.chain.n
    before = base.combination[:, :links] @ updated.stated.ravel()
    size = np.abs(base.combination[:, :links]) @ np.abs(updated.stated).ravel()
    written = base.from_standard(model.parameters)
    rows = []
    for b, expression in enumerate(base.expressions):
        if not base.rigid_body[b]:
            continue
        has_links_only = not np.any(base.combination[b, links:])
        rows.append(
            MeasuredCombination(
                expression=expression,
                unit=base.units[b],
                before=_clean(before[b], size[b]) if has_links_only else None,
                value=float(estimate.values[b]),
                std=float(estimate.sigma[b]),
                written=float(written[b]),
            )
        )
    return tuple(rows)


def _clean(value: float, size: float) -> float:
    """Return a sum, or zero if it is only a rounding error of terms of the given size."""
    return float(value) if abs(value) > ROUNDING * max(size, 1e-3) else 0.0
