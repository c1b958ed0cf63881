"""Arms with meshes from packages that pip installs, and their bodies made by `init --urdf`.

Used by `python -m benchmarks.strangers --meshes`. Pinocchio reads the same URDFs and places the
links in random poses. There, every vertex of a mesh must be inside of a body of the robot file.
"""

from __future__ import annotations

import json
import math
import os
import re
import statistics
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from benchmarks.program_run import ended_programs_s, run_program
from config.arrays import FloatArray
from config.formats.urdf import UrdfTree
from config.formats.urdf_file import read_urdf
from config.load import load_cell
from config.meshes.package_folders import PackageFolders
from config.robot.bodies import Hull
from config.robot.robot import RobotDescription
from config.robot.urdf_bodies import LARGEST_OF_BASE
from config.robot.urdf_chain import UrdfArm, arm_between, held_positions
from config.robot.urdf_meshes import read_link_meshes
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.kinematics import Chain, link_transforms

PACKAGES: Final = (
    "example-robot-data==6.0.0",
    "rtb-data==2.0.0",
    "pybullet==3.2.7",
    "airo-models==0.0.12",
)
INSTALL: Final = '. ./environment.sh && "$(rid_daq_uv)" pip install -q --no-deps --target "$0" "$@"'
"""Shell command that installs packages into a folder by uv, since the environment has no pip."""
ROBOTS: Final = "cmeel.prefix/share/example-robot-data/robots"
XACRO: Final = "rtbdata/xacro"
"""Folders below the folder into which the packages are installed."""

ARMS: Final = (
    f"{ROBOTS}/ur_description/urdf/ur3_robot.urdf",
    f"{ROBOTS}/ur_description/urdf/ur5_robot.urdf",
    f"{ROBOTS}/ur_description/urdf/ur10_robot.urdf",
    f"{ROBOTS}/ur_description/urdf/ur5_gripper.urdf",
    f"{ROBOTS}/panda_description/urdf/panda.urdf",
    f"{ROBOTS}/z1_description/urdf/z1.urdf",
    f"{ROBOTS}/so_arm_description/urdf/so100.urdf",
    f"{ROBOTS}/so_arm_description/urdf/so101.urdf",
    f"{ROBOTS}/kinova_description/robots/kinova.urdf",
    f"{ROBOTS}/xarm_description/urdf/xarm7.urdf",
    f"{ROBOTS}/talos_data/robots/talos_left_arm.urdf",
    f"{ROBOTS}/talos_data/robots/talos_reduced.urdf",
    f"{ROBOTS}/tiago_description/robots/tiago_no_hand.urdf",
    f"{ROBOTS}/tiago_description/robots/tiago.urdf",
    f"{ROBOTS}/tiago_pro_description/robots/tiago_pro.urdf",
    f"{ROBOTS}/baxter_description/urdf/baxter.urdf",
    f"{ROBOTS}/b1_description/urdf/b1-z1.urdf",
    f"{XACRO}/abb_irb140_description/urdf/irb140.urdf",
    f"{XACRO}/kuka_description/kuka_kr16/urdf/kr16_2.urdf",
    f"{XACRO}/kuka_description/kuka_kr120/urdf/kr120r2500pro.urdf",
    f"{XACRO}/kuka_description/kuka_kr210/urdf/kr210l150.urdf",
    f"{XACRO}/kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf",
    f"{XACRO}/unimation_puma560_description/urdf/puma560_robot.urdf",
    f"{XACRO}/lynxmotion_al5d_description/urdf/al5d_robot.urdf",
    "pybullet_data/kuka_iiwa/model.urdf",
    "pybullet_data/franka_panda/panda.urdf",
    "airo_models/arms/ur5e/ur5e.urdf",
)
"""Left out: the UR3e of airo-models and panda_collision.urdf, which have no meshes of <collision>,
and robots that `init` refuses for another reason: PR2 (a reduction of -52143), xArm 6 of pybullet
(a reduction that is not a number), finger_edu and two variants (1000 rad/s).
"""
BODIED_BAR: Final = 0.95
OUTSIDE_BAR_MM: Final = 1.0
"""Pinocchio uses rounded angles as written, `init` as exact multiples of 15 degrees: its links are
in slightly different places. Without rounded angles, no vertex is outside.
"""
MEDIAN_BAR_S: Final = 90.0
POSES: Final = 100
CHECKED_POSES: Final = 3
LONGEST_CPU_S: Final = 360


@dataclass
class MeshedArm:
    """Result for one arm.

    Attributes:
        name: Name of the URDF.
        wall_s, cpu_s: Time of `init --urdf`, with its rehearsal.
        exit_code: Exit code of `init`; 1 if only the rehearsal failed.
        meshed, bodied: Links of the robot that have meshes, and those of them with bodies.
        hulls, points: Number of hulls made, and of their points.
        pairs: Pairs of bodies whose distance is checked.
        pose_ms: Mean time to compute all distances in one pose.
        outside_mm: Largest height of a mesh's vertex above the bodies of its link; negative inside.
        problem: Reason of a failure.
    """

    name: str
    wall_s: float = 0.0
    cpu_s: float = 0.0
    exit_code: int = 0
    meshed: set[int] = field(default_factory=set)
    bodied: set[int] = field(default_factory=set)
    hulls: int = 0
    points: int = 0
    pairs: int = 0
    pose_ms: float = float("nan")
    outside_mm: float = float("nan")
    problem: str = ""

    @property
    def has_bodies(self) -> bool:
        """True if every link with meshes has bodies."""
        return bool(self.meshed) and self.meshed <= self.bodied

    @property
    def has_clearances(self) -> bool:
        """True if the distances of the bodies were computed."""
        return math.isfinite(self.pose_ms)


def try_meshes(robots: Path | None, only: list[str], *, with_table: bool) -> int:
    """Measure every arm and print; the last line is one JSON object.

    Args:
        robots: Folder for the packages; None for a temporary folder.
        only: Words of which the name of an arm must contain one; all arms if empty.
        with_table: Print a line per arm.

    Returns:
        0 if all requirements are met, else 1; 2 if no arm is selected.
    """
    with tempfile.TemporaryDirectory() as temporary:
        folder = robots or Path(temporary) / "robots"
        install(folder)
        arms: list[MeshedArm] = []
        for number, name in enumerate(ARMS):
            if only and not any(word in name for word in only):
                continue
            cell = Path(temporary) / f"cell{number}"
            arms.append(measure((folder / name).resolve(), cell, folder.resolve()))
            if with_table:
                _print(arms[-1], heading=len(arms) == 1)
    if not arms:
        print(f"no arm whose name contains {only}")
        return 2
    meshed = [arm for arm in arms if arm.meshed]
    bodied = sum(arm.has_bodies for arm in meshed)
    computed = sum(arm.has_clearances for arm in arms)
    outside_mm = max((arm.outside_mm for arm in meshed if arm.has_bodies), default=math.inf)
    median_cpu_s = statistics.median(arm.cpu_s for arm in arms)
    holds = (
        bodied >= BODIED_BAR * len(meshed)
        and computed == len(arms)
        and outside_mm <= OUTSIDE_BAR_MM
        and median_cpu_s <= MEDIAN_BAR_S
    )
    result = {
        "name": "strangers_meshes",
        "n": len(arms),
        "with_meshes": len(meshed),
        "with_bodies": bodied,
        "clearances": computed,
        "rehearsed": sum(arm.exit_code == 0 for arm in arms),
        "outside_mm": round(outside_mm, 4),
        "median_s": round(statistics.median(arm.wall_s for arm in arms), 1),
        "median_cpu_s": round(median_cpu_s, 1),
        "load": round(os.getloadavg()[2], 1),
        "bar": f"bodies for {BODIED_BAR:.0%} of the arms with meshes, all distances computed, no"
        f" vertex more than {OUTSIDE_BAR_MM:g} mm outside, median processor time at most"
        f" {MEDIAN_BAR_S:g} s",
        "holds": holds,
        "arms": [
            {
                "urdf": arm.name,
                "wall_s": round(arm.wall_s, 1),
                "cpu_s": round(arm.cpu_s, 1),
                "hulls": arm.hulls,
                "points": arm.points,
                "pairs": arm.pairs,
                "pose_ms": round(arm.pose_ms, 2),
                "problem": arm.problem,
            }
            for arm in arms
        ],
    }
    print(json.dumps(result))
    return 0 if holds else 1


def _print(arm: MeshedArm, *, heading: bool) -> None:
    if heading:
        print(
            f"{'arm':26}{'wall':>8}{'CPU':>8}{'links':>9}{'hulls':>7}{'points':>8}{'pairs':>7}"
            f"{'per pose':>10}{'outside':>11}"
        )
    links = f"{len(arm.bodied & arm.meshed)}/{len(arm.meshed)}"
    print(
        f"{arm.name[:25]:26}{arm.wall_s:>6.0f} s{arm.cpu_s:>6.0f} s{links:>9}{arm.hulls:>7}"
        f"{arm.points:>8}{arm.pairs:>7}{arm.pose_ms:>7.2f} ms{arm.outside_mm:>8.3f} mm"
        f"  {arm.problem[:160]}",
        flush=True,
    )


def install(folder: Path) -> None:
    """Install the packages with the robots, without the programs that they need."""
    if not (folder / ROBOTS).is_dir():
        words = ["bash", "-c", INSTALL, str(folder), *PACKAGES]
        subprocess.run(words, cwd=Path(__file__).parent.parent, check=True)


def measure(urdf: Path, folder: Path, packages: Path) -> MeshedArm:
    """Run `init --urdf` for an arm in a new process, and check its bodies.

    Args:
        urdf: The URDF.
        folder: Folder for the cell.
        packages: Folder with the packages of the meshes.
    """
    arm = MeshedArm(urdf.name)
    tip = None
    words = ["init", str(folder), "--urdf", str(urdf), "--packages", str(packages), "--json"]
    before_s, began_s = ended_programs_s(), time.perf_counter()
    arm.exit_code, output, errors = run_program(words, LONGEST_CPU_S)
    if arm.exit_code and (choice := re.search(r"--tip[ =](?!LINK)([\w.\-/]+)", output or errors)):
        before_s, began_s, tip = ended_programs_s(), time.perf_counter(), choice[1]
        arm.exit_code, output, errors = run_program([*words, "--tip", tip], LONGEST_CPU_S)
    arm.wall_s = time.perf_counter() - began_s
    arm.cpu_s = ended_programs_s() - before_s
    try:
        document = json.loads(output)
    except ValueError:
        arm.problem = ((output or errors).strip().splitlines() or ["no output"])[-1]
        return arm
    if "error" in document:
        arm.problem = document["error"]["message"]
        return arm
    arm.problem = document["obstacle"] or next(
        (note for note in document["notes"] if note.startswith("no bodies")), ""
    )
    robot = load_cell(str(folder / "cell.yaml")).robot
    hulls = [body for body in robot.bodies if body.kind == "hull"]
    arm.bodied = {body.link for body in robot.bodies}
    arm.hulls, arm.points = len(hulls), sum(len(hull.points_m) for hull in hulls)
    clearances = Clearances.of(robot)
    arm.pairs = len(clearances)
    low, high = (
        [getattr(joint.limits, f"position_{end}") for joint in robot.joints]
        for end in ("min", "max")
    )
    poses = np.random.default_rng(0).uniform(low, high, (POSES, len(low)))
    began_s = time.perf_counter()
    found = [clearances.nearest(pose[np.newaxis]) for pose in poses]
    if np.isfinite(found).all():
        arm.pose_ms = 1e3 * (time.perf_counter() - began_s) / POSES
    _check_meshes(arm, urdf, tip, packages, robot)
    return arm


def _check_meshes(
    arm: MeshedArm, urdf: Path, tip: str | None, packages: Path, robot: RobotDescription
) -> None:
    """Compare the bodies with the meshes, whose links Pinocchio places in random poses."""
    tree = read_urdf(urdf.read_bytes(), str(urdf))
    chain = arm_between(tree, None, tip)
    number = _robot_links(tree, chain)
    reach_m = sum(float(np.linalg.norm(joint.placement[:3, 3])) for joint in tree.joints)
    meshes = read_link_meshes(
        tree, PackageFolders(urdf, (packages,)), reach_m, links=number, largest=LARGEST_OF_BASE
    ).by_link
    arm.meshed = {at for link, at in number.items() if tree.links[link].solid.meshes}
    model = pin.buildModelFromUrdf(str(urdf))
    data, geometry = model.createData(), Chain.from_description(robot)
    held = held_positions(tree, chain)
    highest = []
    for pose in np.random.default_rng(1).uniform(-1.0, 1.0, (CHECKED_POSES, geometry.n)):
        stand = held | {joint.name: q for joint, q in zip(chain.joints, pose, strict=True)}
        pin.framesForwardKinematics(model, data, _configuration(model, stand))
        base = data.oMf[_frame(model, chain.base)]
        moved = np.concatenate(
            [np.eye(4)[np.newaxis], link_transforms(geometry, pose[np.newaxis])[0]]
        )
        for name, parts in meshes.items():
            in_base = (base.inverse() * data.oMf[_frame(model, name)]).homogeneous
            in_base[:3, 3] -= robot.base_offset_m
            points = np.concatenate([part.mesh.placed(in_base).vertices_m for part in parts])
            frame = np.linalg.inv(moved[number[name]])
            local = points @ frame[:3, :3].T + frame[:3, 3]
            bodies = [each for each in robot.bodies if each.link == number[name]]
            highest.append(_height_above(bodies, local))
    arm.outside_mm = 1e3 * max(highest, default=float("nan"))


def _robot_links(tree: UrdfTree, chain: UrdfArm) -> dict[str, int]:
    """Return the robot's link with which each of the URDF's links moves."""
    own = {joint.child: i for i, joint in enumerate(chain.joints, start=1)}
    number: dict[str, int] = {}
    waiting = [(chain.base, 0)]
    while waiting:
        link, at = waiting.pop()
        number[link] = at
        waiting += [
            (joint.child, own.get(joint.child, at)) for joint in tree.joints_below.get(link, ())
        ]
    return number


def _frame(model: pin.Model, link: str) -> int:
    """Return the number of a link's frame; a joint can have the same name."""
    return int(model.getFrameId(link, pin.FrameType.BODY))


def _configuration(model: pin.Model, stand: dict[str, float]) -> FloatArray:
    """Return Pinocchio's configuration for positions of joints by name."""
    q = np.asarray(pin.neutral(model))
    for name, position in stand.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 1:
            q[joint.idx_q] = position
        else:  # a continuous joint
            q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
    return q


def _height_above(bodies: Sequence[object], points: FloatArray) -> float:
    """Return the largest height of points above the nearest facets of the bodies [m]."""
    heights = [
        (points @ facets[:, :3].T + facets[:, 3]).max(axis=1) - body.radius_m
        for body in bodies
        if isinstance(body, Hull)
        for facets in [ConvexHull(np.array(body.points_m)).equations]
    ]
    return float(np.min(heights, axis=0).max()) if heights else float("inf")
