"""`MatchedArm`: the arm of a URDF whose axes are those of an identified robot.

Link frames and base frame of the two descriptions may differ. The axes of all joints, as lines in
space at position zero with their positive directions, must be equal except for one rigid motion of
the whole robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from config.arrays import BoolArray, FloatArray
from config.errors import ConfigError
from config.formats.urdf import MOVING, UrdfTree
from config.formats.urdf_file import read_urdf
from config.robot.urdf_chain import UrdfArm, held_positions
from dynamics.geometry.kinematics import flange_pose
from identification.export.model import ExportModel

ANGLE_RAD: Final = 1e-3
DISTANCE_M: Final = 1e-3
NEARLY_PARALLEL: Final = 0.2
EXACT: Final = 1e-12
MOST_EVALUATIONS: Final = 60
"""Maximum number of evaluations of a fit; the fit of equal axes needs fewer than ten."""
WORTH_A_NOTE: Final = 1e-6


@dataclass(frozen=True, eq=False)
class MatchedArm:
    """An arm of a URDF, with the identified robot's frames in it.

    Attributes:
        tree: The URDF.
        arm: The arm's base link, joints, and last moving link.
        places: Pose (4, 4) of each link in the base link, with the arm's joints at zero and the
            other joints held.
        frames: Shape (n + 1, 4, 4). Poses of the identified robot's base frame and link frames in
            the base link.
        angle_rad, distance_m: Largest angle and distance between axes of the URDF and of the robot.
    """

    tree: UrdfTree
    arm: UrdfArm
    places: dict[str, FloatArray]
    frames: FloatArray
    angle_rad: float
    distance_m: float

    def notes(self, model: ExportModel) -> Iterator[str]:
        """Yield notes: facts that the axes do not prove, and small differences of the axes."""
        names = [joint.name for joint in self.arm.joints]
        if tuple(names) != model.robot.joint_names:
            pairs = zip(names, model.robot.joint_names, strict=True)
            yield "joints of the URDF and of the model: " + ", ".join(
                f"{a} = {b}" for a, b in pairs
            )
        if self.angle_rad > WORTH_A_NOTE or self.distance_m > WORTH_A_NOTE:
            yield (
                f"the axes of the URDF differ from those of the model by up to"
                f" {1e3 * self.angle_rad:.2g} mrad and {1e3 * self.distance_m:.2g} mm"
            )
        if self.link_at_tool(model) is None:
            yield (
                "no link of the URDF is at the model's tool frame: the zero position of"
                f" {names[-1]} was not compared, and is assumed to be that of the model"
            )
        expected = self.frames[0][:3, :3] @ model.model.chain.gravity_m_s2
        root = self.tree.placements(self.tree.root_of(self.arm.base))[self.arm.base][:3, :3]
        down = -root[2]
        size = float(np.linalg.norm(expected))
        if size and np.linalg.norm(expected / size - down) > ANGLE_RAD:
            here = " ".join(f"{x:.4g}" for x in root @ expected)
            yield (
                f"the robot was identified with the gravity ({here}) m/s^2 in the root frame of the"
                " URDF: set it in the simulator, or correct the base joint; simulators assume -z."
                f" If the robot stands upright, the zero position of {names[0]} differs from that"
                " of the model"
            )

    def link_at_tool(self, model: ExportModel) -> str | None:
        """Return the link behind the last joint whose frame is the model's tool frame."""
        tool = self.frames[-1] @ flange_pose(model.robot)
        last = self.arm.joints[-1].child
        waiting = [last]
        while waiting:
            link = waiting.pop(0)
            difference = self.places[link] - tool
            if (
                np.abs(difference[:3, 3]).max() < DISTANCE_M
                and np.abs(difference[:3, :3]).max() < ANGLE_RAD
            ):
                return link
            waiting += [
                joint.child
                for joint in self.tree.joints_below.get(link, ())
                if joint.kind not in MOVING
            ]
        return None


def match_arm(tree: UrdfTree, model: ExportModel, tip: str | None = None) -> MatchedArm:
    """Return the arm of a URDF that is the identified robot.

    Among several equal arms, the one with the model's joint names is chosen.

    Args:
        tree: The URDF.
        model: The identified robot.
        tip: A link behind the arm's last joint, if several arms are equal.

    Raises:
        ConfigError: `tip` is not a link (RID-URDF-LINK), no arm has the robot's axes
            (RID-URDF-KINEMATICS), or several arms have them (RID-URDF-ARM).
    """
    if tip is not None and tip not in tree.links:
        raise ConfigError(
            f"{tree.file}: no link is named {tip!r}; links are {', '.join(tree.links)}",
            code="RID-URDF-LINK",
        )
    n, names = model.model.chain.n, model.robot.joint_names
    arms = [arm for arm in _arms(tree, n) if tip is None or _is_behind(tree, arm, tip)]
    if not arms:
        below = f" before {tip!r}" if tip is not None else ""
        driven = sum(joint.is_driven for joint in tree.joints)
        raise ConfigError(
            f"{tree.file}: no arm with {n} driven joints{below}, as the model's robot"
            f" {model.robot.name!r} has ({', '.join(names)}); the URDF has {driven} driven joints."
            " A joint with <mimic> is not driven",
            code="RID-URDF-KINEMATICS",
        )
    tried = [_Comparison.of(tree, arm, model) for arm in arms]
    equal = [one for one in tried if one.is_equal]
    if not equal:
        named = [one for one in tried if one.names == names]
        nearest = (named or sorted(tried, key=lambda one: one.size))[0]
        raise ConfigError(
            f"{tree.file}: the axes differ from those of the model's robot"
            f" {model.robot.name!r}: {nearest.words}. Allowed are {1e3 * ANGLE_RAD:g} mrad and"
            f" {1e3 * DISTANCE_M:g} mm, after the best fit of the whole robot. Check zero"
            " positions, signs and lengths",
            code="RID-URDF-KINEMATICS",
        )
    by_name = [one for one in equal if one.names == names]
    if len(equal) > 1 and len(by_name) != 1:
        choices = ", ".join(f"--tip {one.arm.tip}" for one in equal)
        raise ConfigError(
            f"{tree.file}: {len(equal)} arms have the axes of the model's robot; choose one:"
            f" {choices}",
            code="RID-URDF-ARM",
        )
    return (by_name or equal)[0].matched()


def read_arm(
    data: bytes, file: str, model: ExportModel, tip: str | None = None
) -> tuple[bool, MatchedArm]:
    """Return the arm of a URDF that is the identified robot, and True if angles are as written.

    Rounded angles are replaced by exact ones (`AngleReading`) if the axes then agree better.

    Args:
        data: The file's bytes.
        file: Name of the file in messages.
        model: The identified robot.
        tip: As for `match_arm`.

    Raises:
        ConfigError: Neither reading has an arm with the model's axes, or the file cannot be read.
    """
    found: list[tuple[bool, MatchedArm]] = []
    refused: list[ConfigError] = []
    for literal in (False, True):
        try:
            tree = read_urdf(data, file, literal_angles=literal)
            found.append((literal, match_arm(tree, model, tip)))
        except ConfigError as error:
            if error.refusal != "RID-URDF-KINEMATICS":
                raise
            refused.append(error)
    if not found:
        raise refused[0]
    return min(found, key=lambda each: each[1].angle_rad + each[1].distance_m)


@dataclass(frozen=True, eq=False)
class _Comparison:
    """A candidate arm, and the deviations of its axes: angles [rad] and distances [m], (n,)."""

    tree: UrdfTree
    arm: UrdfArm
    frames: FloatArray
    angles: FloatArray
    distances: FloatArray
    kinds: tuple[bool, ...]

    @classmethod
    def of(cls, tree: UrdfTree, arm: UrdfArm, model: ExportModel) -> _Comparison:
        places = tree.placements(arm.base)
        frames = [np.eye(4)]
        for placement in model.placements:
            frames.append(frames[-1] @ placement)
        own = np.array(frames)
        points = np.array([places[joint.child][:3, 3] for joint in arm.joints])
        axes = np.array([places[joint.child][:3, :3] @ joint.axis for joint in arm.joints])
        prismatic = np.array([joint.kind == "prismatic" for joint in arm.joints])
        kinds = tuple((prismatic == model.model.chain.prismatic).tolist())
        root = tree.placements(tree.root_of(arm.base))[arm.base][:3, :3]
        gravity = -root[2], model.model.chain.gravity_m_s2
        target = _Lines(points, axes, prismatic)
        source = _Lines(own[1:, :3, 3], own[1:, :3, 2], prismatic)
        fit = _fit(target, source, gravity)
        found = source.moved(fit)
        sines, distances = (np.linalg.norm(gap, axis=1) for gap in target.gaps(found))
        angles = np.arctan2(sines, np.sum(found.directions * axes, axis=1))
        return cls(tree, arm, np.array([fit @ frame for frame in own]), angles, distances, kinds)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.arm.joints)

    @property
    def is_equal(self) -> bool:
        return (
            all(self.kinds)
            and float(self.angles.max()) <= ANGLE_RAD
            and float(self.distances.max()) <= DISTANCE_M
        )

    @property
    def size(self) -> float:
        return float(self.angles.sum() + self.distances.sum()) + self.kinds.count(False)

    @property
    def words(self) -> str:
        """Texts on the deviations of every joint whose axes are not equal."""
        words = []
        rows = zip(self.arm.joints, self.kinds, self.angles, self.distances, strict=True)
        for joint, is_same_kind, angle, distance in rows:
            if not is_same_kind:
                words.append(f"{joint.name} is {joint.kind}, which the model's joint is not")
            elif angle > ANGLE_RAD or distance > DISTANCE_M:
                reverse = " (it turns the other way)" if angle > np.pi - ANGLE_RAD else ""
                words.append(f"{joint.name} {angle:.4g} rad{reverse}, {1e3 * distance:.4g} mm")
        return "; ".join(words)

    def matched(self) -> MatchedArm:
        angle, distance = float(self.angles.max()), float(self.distances.max())
        places = self.tree.placements(self.arm.base, held_positions(self.tree, self.arm))
        return MatchedArm(self.tree, self.arm, places, self.frames, angle, distance)


def _arms(tree: UrdfTree, n: int) -> Iterator[UrdfArm]:
    """Yield every chain of n driven joints in a row; none contains a joint that mimics another."""
    for last in tree.joints:
        if not last.is_driven:
            continue
        path = tree.path(tree.root_of(last.child), last.child)
        driven = [joint for joint in path if joint.is_driven][-n:]
        if len(driven) < n:
            continue
        inside = path[path.index(driven[0]) :]
        if all(joint.is_driven or joint.kind not in MOVING for joint in inside):
            yield UrdfArm(driven[0].parent, last.child, tuple(driven))


def _is_behind(tree: UrdfTree, arm: UrdfArm, tip: str) -> bool:
    """Return True if the arm's last joint is the last driven joint before a link."""
    driven = [joint for joint in tree.path(tree.root_of(tip), tip) if joint.is_driven]
    return bool(driven) and driven[-1] is arm.joints[-1]


@dataclass(frozen=True, eq=False)
class _Lines:
    """Joint axes as lines: points (n, 3), directions (n, 3), and True for sliding joints (n,)."""

    points: FloatArray
    directions: FloatArray
    slides: BoolArray

    def moved(self, motion: FloatArray) -> _Lines:
        """Return the lines after a rigid motion (4, 4)."""
        turn = motion[:3, :3]
        return _Lines(self.points @ turn.T + motion[:3, 3], self.directions @ turn.T, self.slides)

    def between(self, first: int, second: int) -> FloatArray:
        """Return the vector between two lines, normal to the first one, (3,)."""
        vector, axis = self.points[second] - self.points[first], self.directions[first]
        return np.asarray(vector - axis * (vector @ axis))

    def gaps(self, other: _Lines) -> tuple[FloatArray, FloatArray]:
        """Compare each line with the line of the same number in `other`.

        Return two arrays of vectors, (n, 3) each. The lengths of the first are the sines of the
        angles between the two directions; those of the second are the distances of this line's
        point from the other line. The place of an axis along which a joint slides has no effect:
        its distance is zero.
        """
        across = np.cross(self.points - other.points, other.directions)
        across[self.slides] = 0.0
        return np.cross(other.directions, self.directions), across


def _fit(target: _Lines, source: _Lines, gravity: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the rigid motion (4, 4) that takes the model's axes to the URDF's.

    Directions determine the rotation. If all axes are nearly parallel, the distances between them
    and the direction of gravity determine it. The translation is a least-squares solution; along
    parallel axes it takes the first points onto each other. If the axes are not equal, all six
    coordinates are then adjusted so that the sum of squared gaps is least.

    Args:
        target, source: The axes in the URDF and in the model.
        gravity: Direction of gravity in the URDF, and gravity in the model.
    """
    pairs = list(zip(target.directions, source.directions, strict=True))
    if np.linalg.svd(target.directions)[1][1:].sum() < NEARLY_PARALLEL:
        turning = np.flatnonzero(~target.slides)
        pairs += [
            (target.between(turning[0], i), source.between(turning[0], i)) for i in turning[1:]
        ]
        pairs.append((1e-3 * gravity[0], 1e-4 * gravity[1]))
    wanted, given = (np.array(side) for side in zip(*pairs, strict=True))
    left, _, right = np.linalg.svd(wanted.T @ given)
    motion = np.eye(4)
    motion[:3, :3] = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    motion[:3, 3] = target.points[0] - motion[:3, :3] @ source.points[0]
    rows = [np.eye(3) - np.outer(axis, axis) for axis in target.directions[~target.slides]]
    if rows:
        missing = (target.points - source.moved(motion).points)[~target.slides]
        steps = [row @ gap for row, gap in zip(rows, missing, strict=True)]
        motion[:3, 3] += np.linalg.lstsq(np.vstack(rows), np.concatenate(steps), rcond=1e-9)[0]

    def residuals(x: FloatArray) -> FloatArray:
        return np.concatenate([gap.ravel() for gap in target.gaps(source.moved(_step(x) @ motion))])

    if np.abs(residuals(np.zeros(6))).max() < EXACT:
        return motion
    # The axes of another arm may have no best fit: the translation grows without end.
    found = least_squares(
        residuals, np.zeros(6), xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=MOST_EVALUATIONS
    )
    return np.asarray(_step(found.x) @ motion)


def _step(x: FloatArray) -> FloatArray:
    """Return the rigid motion (4, 4) of a rotation vector and a translation, (6,)."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(x[:3]).as_matrix()
    motion[:3, 3] = x[3:]
    return motion
