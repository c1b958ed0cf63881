"""A robot file, a simulated cell and a validation motion out of a URDF: `init --urdf`."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.kinds.multipoint import MultipointMotion
from config.cell.cell import CanBusConfig, CellConfig, DriveAxis, DriveSafety, Supervision
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.urdf import read_urdf
from config.formats.xml_tree import MAX_BYTES
from config.formats.yaml_tree import dump_yaml
from config.model import ConfigModel
from config.robot.robot import Joint, RobotDescription
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from config.simulation.plant import LinkInertia, PlantConfig, SimulatedAxis
from dynamics.model.cad import cad_parameters
from dynamics.model.inverse_dynamics import mass_matrix
from dynamics.model.robot_model import RobotModel

# The simulated motors and loops, which a URDF says nothing of.
BANDWIDTH_RAD_S: Final = (60.0, 500.0)
FRICTION_SHARE: Final = 0.04
BREAKAWAY_SPEED_RAD_S: Final = 0.05
TORQUE_NOISE_SHARE: Final = 0.003
INCREMENTS_PER_TURN: Final = 2_000_000
VALIDATION_LIMIT_PERCENT: Final = 15.0


def urdf_files(path: Path, base: str | None, tip: str | None) -> tuple[dict[str, str], UrdfRobot]:
    """Return the text of every file to start from, by name, and the robot that they are for.

    Without masses in the URDF nothing can be simulated, and the cell is one for real drives.

    Raises
    ------
    ConfigError
        The URDF cannot be read or makes no robot.
    """
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}") from None
    made = robot_of_urdf(read_urdf(data, str(path)), base=base, tip=tip)
    robot = made.robot
    files = {"robot.yaml": _text(robot, _robot_comment(path, made))}
    plant = None
    if robot.cad is not None:
        plant = _plant(robot)
        files["plant.yaml"] = _text(
            plant,
            "What is simulated: the URDF's masses; motors, friction and loops are invented.\n"
            "Delete it, and `simulated` and `plant` in cell.yaml, once drives are there.",
        )
    files["cell.yaml"] = _text(_cell(robot, simulated=plant is not None), _CELL_COMMENT)
    motion = MultipointMotion(kind="multipoint", robot=robot.name, seed=1)
    files["validation.yaml"] = _text(
        motion, "Random points: run it after the excitation and give it to `rid-daq validate`."
    )
    return files, made


_CELL_COMMENT: Final = """\
A cell: one robot, its drives, their bus, the cycle. `rid-daq init` without a URDF writes one in
which every key is explained. Node ids, signs and zero positions are yours to correct before
anything moves; `rid-daq check cell.yaml` shows what the drives say."""

_ROBOT_COMMENT: Final = """\
Made from {file} by rid-daq init. Frames are those of the modified Denavit-Hartenberg convention:
frame i on axis i, z along it. What a URDF does not say stands at a default; correct it:
- limits.acceleration is five times the velocity, per second.
- rotor (link, axis) tells where a motor sits and which way it spins; armature: true stands for
  a motor whose place is not known. gear_ratio is motor turns per joint turn.
- cad is what the URDF says of the links: a prior with `uncertainty`, never a result.
{notes}"""


def _robot_comment(path: Path, made: UrdfRobot) -> str:
    notes = "".join(f"- {note}\n" for note in made.notes)
    return _ROBOT_COMMENT.format(file=path.name, notes=notes)


def _text(model: ConfigModel, comment: str) -> str:
    return dump_yaml(model.model_dump(mode="json", exclude_defaults=True), comment)


def _cell(robot: RobotDescription, *, simulated: bool) -> CellConfig:
    return CellConfig(
        name=robot.name,
        robot="robot.yaml",
        simulated=simulated,
        plant="plant.yaml" if simulated else None,
        cycle_time_ms=8,
        can=CanBusConfig(
            interface="rid_sim" if simulated else "socketcan",
            channel=robot.name if simulated else "can0",
        ),
        axes=tuple(
            DriveAxis(joint=name, node_id=number)
            for number, name in enumerate(robot.joint_names, start=1)
        ),
        position_gain_per_s=10.0,
        supervision=Supervision(stuck_encoder_velocity_rad_s=0.2, late_by_cycles_limit=8.0)
        if simulated
        else Supervision(),
        drive_safety=DriveSafety(
            quick_stop_deceleration_rad_s2=max(j.limits.acceleration for j in robot.joints),
            following_error_rad=0.1,
        ),
        validation_limits_percent=(VALIDATION_LIMIT_PERCENT,) * len(robot.joints),
    )


def _plant(robot: RobotDescription) -> PlantConfig:
    """Return the URDF's links with motors that can move them."""
    model = RobotModel.from_description(robot, rotors=False, friction=False, spring=False)
    values, _ = cad_parameters(model, robot)
    rest = np.array([[_start(joint) for joint in robot.joints]])
    inertias = np.diagonal(mass_matrix(model, rest, values)[0])
    links = []
    for cad in robot.cad or ():
        xx, xy, xz, yy, yz, zz = cad.inertia_kg_m2
        links.append(
            LinkInertia(
                mass_kg=cad.mass_kg,
                centre_m=cad.centre_m,
                inertia_kg_m2=(xx, yy, zz, xy, xz, yz),
            )
        )
    return PlantConfig(
        name=robot.name,
        links=tuple(links),
        axes=tuple(
            _axis(joint, float(inertia))
            for joint, inertia in zip(robot.joints, inertias, strict=True)
        ),
    )


def _axis(joint: Joint, inertia: float) -> SimulatedAxis:
    torque, ratio = joint.limits.torque, abs(joint.gear_ratio)
    inertia = max(inertia, 1e-3 * torque / joint.limits.acceleration)
    slowest, fastest = BANDWIDTH_RAD_S
    gain = min(max(torque / joint.limits.velocity, slowest * inertia), fastest * inertia)
    # Not more friction than the loop overcomes at once: without rotors wrists are light.
    friction = min(FRICTION_SHARE * torque, BREAKAWAY_SPEED_RAD_S * gain)
    return SimulatedAxis(
        rotor_inertia_kg_m2=0.0,
        coulomb_nm=friction,
        viscous_nm_s=friction / joint.limits.velocity,
        velocity_gain_nm_s=gain,
        velocity_integral_time_s=0.1,
        rated_motor_torque_nm=torque / (3.0 * ratio),
        peak_motor_torque_nm=torque / ratio,
        encoder_increments_per_motor_rev=int(np.clip(INCREMENTS_PER_TURN / ratio, 16, 2**24)),
        torque_noise_nm=TORQUE_NOISE_SHARE * torque,
        brake_torque_nm=torque,
        initial_position=_start(joint),
    )


def _start(joint: Joint) -> float:
    """Return where a joint stands at first: at zero, or in the middle where zero is outside."""
    low, high = joint.limits.position_min, joint.limits.position_max
    return 0.0 if low < 0.0 < high else 0.5 * (low + high)
