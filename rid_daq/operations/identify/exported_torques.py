"""`ExportedTorques`: torques of an exported robot description, compared with its model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.export.torque_gap import TorqueGap
from rid_daq.blocks.block import AnyBlock, Cells, Heading, Text, table
from rid_daq.blocks.formats import unit
from rid_daq.report.sections.section import Section


class ExportedTorques(Section):
    """Torques of a joint on random motions within the limits, RMS.

    Attributes:
        joint: The joint's name in the file.
        unit: Unit of the torques.
        armature: Inertia of the rotor at the link side [kg m^2 or kg].
        model_rms: Torques of the identified model.
        difference_rms: Differences between the torques of the file, with armatures, and of the
            model.
        difference_without_armature_rms: The same without armatures; null if the format has them.
    """

    joint: str
    unit: str
    armature: float
    model_rms: float
    difference_rms: float
    difference_without_armature_rms: float | None


def exported_torques(
    estimate: Estimate, model: ExportModel, joints: Sequence[str], *, has_armatures: bool
) -> tuple[ExportedTorques, ...]:
    """Compare the torques of a robot description with those of the identified model.

    Args:
        estimate: The identified model.
        model: The parameters in the file.
        joints: Names of the joints in the file.
        has_armatures: True if the format has armatures.
    """
    gap = TorqueGap.of(estimate, model)
    return tuple(
        ExportedTorques(
            joint=name,
            unit=model.robot.joints[j].torque_unit,
            armature=model.armature(j),
            model_rms=float(gap.model_nm[j]),
            difference_rms=float(gap.with_armature_nm[j]),
            difference_without_armature_rms=(
                None if has_armatures else float(gap.without_armature_nm[j])
            ),
        )
        for j, name in enumerate(joints)
    )


def torque_blocks(torques: Sequence[ExportedTorques]) -> Iterator[AnyBlock]:
    """Yield the torques as a table."""
    has_armatures = all(each.difference_without_armature_rms is None for each in torques)
    alone: tuple[Cells[ExportedTorques], ...] = (
        Cells("without armature", lambda each: each.difference_without_armature_rms),
    )
    yield Heading(text="Torques of the file and of the model")
    yield table(
        torques,
        Cells("joint", lambda each: each.joint),
        Cells("unit", lambda each: unit(each.unit)),
        Cells("armature", lambda each: each.armature),
        Cells("RMS torque", lambda each: each.model_rms),
        Cells("RMS difference", lambda each: each.difference_rms),
        *(() if has_armatures else alone),
    )
    simulator = "" if has_armatures else ", if the simulator adds the armatures, and without them"
    yield Text(text=f"Random motions within the limits of the joints{simulator}.", is_note=True)
