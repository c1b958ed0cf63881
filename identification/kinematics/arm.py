"""`PlacedArm`: an arm with elastic gears in the frame of an instrument that measures its point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from config.arrays import FloatArray
from dynamics.geometry.kinematics import Chain, link_transforms, point_jacobian
from identification.kinematics.gravity import Gravity
from identification.kinematics.parameters import KinematicParameter


@dataclass(frozen=True, eq=False)
class PlacedArm:
    """Geometry and compliance of an arm, and the place of its base in the instrument's frame.

    Attributes:
        chain: The geometry; `tool_m` is the measured point in the frame of the last link.
        rotation: Shape (3, 3). Orientation of frame 0 in the instrument's frame.
        origin_m: Shape (3,). Origin of frame 0 in the instrument's frame.
        compliance: Shape (n,). Compliance of each gear [rad/(N m) or m/N].
        gravity: Torques at rest; None if they are unknown, and the gears count as rigid.
    """

    chain: Chain
    rotation: FloatArray
    origin_m: FloatArray
    compliance: FloatArray
    gravity: Gravity | None

    def registered(self, position: FloatArray, point_m: FloatArray) -> PlacedArm:
        """Return the arm with the base frame that fits the measured points best (Kabsch).

        Args:
            position: Shape (samples, n). Joint positions [rad or m].
            point_m: Shape (samples, 3). Measured points.
        """
        base = replace(self, rotation=np.eye(3), origin_m=np.zeros(3))
        here = base.points(position, np.zeros(len(position)))
        centre, measured = here.mean(axis=0), point_m.mean(axis=0)
        turn, _ = Rotation.align_vectors(point_m - measured, here - centre)
        rotation = turn.as_matrix()
        return replace(self, rotation=rotation, origin_m=measured - rotation @ centre)

    def points(self, position: FloatArray, load_kg: FloatArray) -> FloatArray:
        """Return the point in the instrument's frame, (samples, 3) [m].

        Args:
            position: Shape (samples, n). Joint positions from the encoders [rad or m].
            load_kg: Shape (samples,). Mass at the flange.
        """
        links, _ = self._links(position, load_kg)
        last = link_transforms(self.chain, links)[:, -1]
        tool = last[:, :3, :3] @ self.chain.tool_m + last[:, :3, 3]
        return np.asarray(tool @ self.rotation.T + self.origin_m)

    def slopes(
        self,
        position: FloatArray,
        load_kg: FloatArray,
        parameters: Sequence[KinematicParameter],
    ) -> FloatArray:
        """Return the derivatives of the point by some parameters, (samples, 3, parameters).

        The change of the deflection by the geometry is neglected.
        """
        links, torque = self._links(position, load_kg)
        transforms = link_transforms(self.chain, links)
        last = transforms[:, -1]
        tool = last[:, :3, :3] @ self.chain.tool_m + last[:, :3, 3]
        ends = np.full(len(position), self.chain.n)
        turning = point_jacobian(self.chain, transforms, ends, tool)
        columns = np.empty((len(position), 3, len(parameters)))
        for column, each in enumerate(parameters):
            if each.kind == "frame":
                placed = tool @ self.rotation.T
                columns[:, :, column] = (
                    np.eye(3)[each.element]
                    if each.element < 3
                    else np.cross(np.eye(3)[each.element - 3], placed)
                )
                continue
            if each.kind == "point":
                moved = last[:, :3, each.element]
            elif each.kind == "row":
                moved = self._row_slope(transforms, tool, each.joint, each.element)
            else:
                coupling = np.eye(self.chain.n) if self.gravity is None else self.gravity.coupling
                bent = turning @ coupling[:, each.joint]
                moved = -torque[:, each.joint, np.newaxis] * bent
            columns[:, :, column] = moved @ self.rotation.T
        return columns

    def moved(self, parameters: Sequence[KinematicParameter], step: FloatArray) -> PlacedArm:
        """Return the arm with changed parameters; the frame turns about the instrument's axes."""
        rows, tool = self.chain.rows.copy(), self.chain.tool_m.copy()
        origin, turn = self.origin_m.copy(), np.zeros(3)
        compliance = self.compliance.copy()
        for each, change in zip(parameters, step, strict=True):
            if each.kind == "frame" and each.element < 3:
                origin[each.element] += change
            elif each.kind == "frame":
                turn[each.element - 3] += change
            elif each.kind == "point":
                tool[each.element] += change
            elif each.kind == "row":
                rows[each.joint, each.element] += change
            else:
                compliance[each.joint] += change
        chain = replace(self.chain, rows=rows, tool_m=tool)
        rotation = Rotation.from_rotvec(turn).as_matrix() @ self.rotation
        return replace(self, chain=chain, rotation=rotation, origin_m=origin, compliance=compliance)

    def value(self, parameter: KinematicParameter) -> float:
        """Return the value of a parameter; the frame's rotation is a rotation vector [rad]."""
        if parameter.kind == "frame":
            turn = Rotation.from_matrix(self.rotation).as_rotvec()
            return float(np.concatenate([self.origin_m, turn])[parameter.element])
        if parameter.kind == "point":
            return float(self.chain.tool_m[parameter.element])
        if parameter.kind == "row":
            return float(self.chain.rows[parameter.joint, parameter.element])
        return float(self.compliance[parameter.joint])

    def _links(self, position: FloatArray, load_kg: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self.gravity is None:
            return position, np.zeros_like(position)
        return self.gravity.link_positions(position, load_kg, self.compliance)

    def _row_slope(
        self, transforms: FloatArray, tool: FloatArray, joint: int, element: int
    ) -> FloatArray:
        """Return the derivative of the point in frame 0 by an element of a row, (samples, 3)."""
        here = transforms[:, joint]
        before = transforms[:, joint - 1] if joint else np.broadcast_to(np.eye(4), here.shape)
        x, z = before[:, :3, 0], here[:, :3, 2]
        if element == 0:  # alpha
            return np.cross(x, tool - before[:, :3, 3])
        if element == 1:  # beta: about y after Rot_x(alpha) Trans_x(a)
            y = np.cross(z, x) / np.linalg.norm(np.cross(z, x), axis=1)[:, np.newaxis]
            foot = before[:, :3, 3] + self.chain.rows[joint, 3] * x
            return np.cross(y, tool - foot)
        if element == 2:  # theta
            return np.cross(z, tool - here[:, :3, 3])
        return x if element == 3 else z
