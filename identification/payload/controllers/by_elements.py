"""Load data with the inertia as elements of its matrix: FANUC, UR, Franka, Staubli, URDF."""

from __future__ import annotations

import json
import re
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.formats.urdf import rotation_of_rpy
from identification.payload.body import PayloadBody
from identification.payload.controllers.text import (
    NUMBER,
    Digits,
    comments,
    find_match,
    match_numbers,
)

KGF_CM_S2: Final = 0.0980665
"""One kgf cm s^2 in kg m^2: 9.80665 N times 0.01 m times s^2."""
LARGEST_UR_KG_M2: Final = 133.0

# FANUC: the payload schedule's screen, in cm and kgf cm s^2, without products of inertia.

_FANUC_LINES: Final = (
    "PAYLOAD [kg]",
    "PAYLOAD CENTER X [cm]",
    "PAYLOAD CENTER Y [cm]",
    "PAYLOAD CENTER Z [cm]",
    "PAYLOAD INERTIA X [kgfcms^2]",
    "PAYLOAD INERTIA Y [kgfcms^2]",
    "PAYLOAD INERTIA Z [kgfcms^2]",
)


def to_fanuc(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write a FANUC payload schedule."""
    inertia = body.inertia_kg_m2
    moments = np.diagonal(inertia) / KGF_CM_S2
    xy, xz, yz = inertia[0, 1], inertia[0, 2], inertia[1, 2]
    head = (
        *origin,
        "Payload schedule, as its screen shows it: kg, cm, kgf cm s^2 (0.0980665 kg m^2).",
        "Frame: the faceplate with X up, Y right seen from behind, Z out. The robot file's tool",
        "frame must be this frame. Inertia about the centre of gravity. It has no products of",
        f"inertia: Ixy, Ixz, Iyz = {digits(xy)}, {digits(xz)}, {digits(yz)} kg m^2 are left out.",
    )
    values = [body.mass_kg, *(1e2 * body.centre_m), *moments]
    lines = (f"{name:<28} {digits(v)}\n" for name, v in zip(_FANUC_LINES, values, strict=True))
    return comments("#", head) + "".join(lines)


def from_fanuc(text: str) -> PayloadBody:
    """Read a FANUC payload schedule; raise ValueError for any other text."""
    values = np.array(
        [
            float(find_match(rf"(?m)^{re.escape(name)}\s+{NUMBER}\s*$", text, name).group(1))
            for name in _FANUC_LINES
        ]
    )
    return PayloadBody(float(values[0]), values[1:4] / 1e2, np.diag(values[4:] * KGF_CM_S2))


# Universal Robots: SI, the whole matrix as Ixx, Iyy, Izz, Ixy, Ixz, Iyz in the flange's axes.


def to_ur(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write Universal Robots' set_target_payload."""
    elements = _ur_elements(body)
    head = (
        *origin,
        "set_target_payload(m [kg], centre of gravity [m] from the tool flange, inertia [kg m^2]",
        "Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity in the flange's axes, transition",
        "time [s]). The call sets the force-torque sensor to zero.",
    )
    centre = ", ".join(digits(x) for x in body.centre_m)
    inertia = ", ".join(digits(x) for x in elements)
    return (
        comments("#", head)
        + f"set_target_payload({digits(body.mass_kg)}, [{centre}], [{inertia}], 0.1)\n"
    )


def from_ur(text: str) -> PayloadBody:
    """Read Universal Robots' set_target_payload; raise ValueError for any other text."""
    further = rf"\s*,\s*{NUMBER}"
    pattern = (
        rf"(?m)^\s*set_target_payload\(\s*{NUMBER}\s*,\s*\[\s*{NUMBER}{2 * further}\s*\]\s*,"
        rf"\s*\[\s*{NUMBER}{5 * further}\s*\]"
    )
    values = match_numbers(
        find_match(pattern, text, "set_target_payload(m, [x, y, z], [six elements])")
    )
    return PayloadBody.of_reported(values)


def _ur_elements(body: PayloadBody) -> FloatArray:
    """Return Ixx, Iyy, Izz, Ixy, Ixz, Iyz if the controller accepts them.

    Raises:
        EstimationError: An element is too large.
    """
    elements = body.reported[4:]
    if np.max(np.abs(elements)) > LARGEST_UR_KG_M2:
        raise EstimationError(
            f"an inertia of {np.max(np.abs(elements)):.4g} kg m^2 exceeds the controller's"
            f" largest value ({LARGEST_UR_KG_M2:g} kg m^2): check the payload",
            code="RID-LOAD-DATA-RANGE",
        )
    return elements


# Universal Robots' ROS 2 driver: a request of the service set_payload, in YAML.

_UR_ROS2_ELEMENTS: Final = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def to_ur_ros2(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write a request of the service set_payload of Universal Robots' ROS 2 driver."""
    head = (
        *origin,
        "Request of ur_msgs/srv/SetPayload for the ROS 2 driver:",
        "ros2 service call /io_and_status_controller/set_payload ur_msgs/srv/SetPayload"
        ' "$(cat FILE)"',
        "mass [kg]; center_of_gravity [m] from the tool flange; inertia [kg m^2] about the centre",
        "of gravity in the flange's axes. NOT VERIFIED with a driver. Older versions of ur_msgs",
        "have neither inertia nor transition_time in this message: delete these lines for them.",
    )
    x, y, z = (digits(value) for value in body.centre_m)
    inertia = zip(_UR_ROS2_ELEMENTS, _ur_elements(body), strict=True)
    return (
        comments("#", head)
        + "transition_time: {sec: 0, nanosec: 100000000}\n"
        + f"mass: {digits(body.mass_kg)}\n"
        + f"center_of_gravity: {{x: {x}, y: {y}, z: {z}}}\n"
        + "".join(f"{name}: {digits(value)}\n" for name, value in inertia)
    )


def from_ur_ros2(text: str) -> PayloadBody:
    """Read a request of the service set_payload; raise ValueError for any other text."""
    centre = rf"\{{\s*x: {NUMBER}\s*,\s*y: {NUMBER}\s*,\s*z: {NUMBER}\s*\}}"
    patterns = [
        rf"(?m)^mass: {NUMBER}\s*$",
        rf"(?m)^center_of_gravity: {centre}\s*$",
        *(rf"(?m)^{name}: {NUMBER}\s*$" for name in _UR_ROS2_ELEMENTS),
    ]
    found = [match_numbers(find_match(each, text, each.split(":")[0][5:])) for each in patterns]
    return PayloadBody.of_reported(np.concatenate(found))


# Franka: SI, 3 x 3 column by column.


def to_franka(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write Franka's setLoad."""
    document = {
        "about": [
            *origin,
            "setLoad(load_mass, F_x_Cload, load_inertia): load_mass [kg]; F_x_Cload [m], centre of"
            " gravity from the flange; load_inertia [kg m^2], 3 x 3 column by column, about the"
            " centre of gravity in the flange's axes. The controller adds this load to the end"
            " effector that is configured in Desk.",
        ],
        "load_mass": float(digits(body.mass_kg)),
        "F_x_Cload": [float(digits(x)) for x in body.centre_m],
        "load_inertia": [float(digits(x)) for x in body.inertia_kg_m2.flatten(order="F")],
    }
    return json.dumps(document, ensure_ascii=False, indent=1) + "\n"


def from_franka(text: str) -> PayloadBody:
    """Read Franka's setLoad; raise ValueError, KeyError or TypeError for any other text."""
    document = json.loads(text)
    inertia = np.array(document["load_inertia"], dtype=float)
    if inertia.shape != (9,):
        raise ValueError("load_inertia does not have nine elements")
    return PayloadBody(
        float(document["load_mass"]),
        np.array(document["F_x_Cload"], dtype=float),
        inertia.reshape(3, 3, order="F"),
    )


# Staubli: values of the tool's load, as a table to be entered by hand.

_STAUBLI_LINES: Final = (
    "mass_kg",
    "x_mm",
    "y_mm",
    "z_mm",
    "Ixx_kg_m2",
    "Iyy_kg_m2",
    "Izz_kg_m2",
    "Ixy_kg_m2",
    "Ixz_kg_m2",
    "Iyz_kg_m2",
)


def to_staubli(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write a Staubli tool's load."""
    values = np.array(body.reported)
    values[1:4] *= 1e3
    head = (
        *origin,
        "Load of the tool, to be entered by hand: mass [kg]; centre of gravity [mm] from the",
        "flange; inertia [kg m^2] about the centre of gravity in the flange's axes, as elements of",
        "the matrix (Ixy = -integral of x y dm). NOT VERIFIED with a controller: the controller",
        "uses other names; see its manual for its values and the signs of its products.",
    )
    lines = (f"{name} = {digits(v)}\n" for name, v in zip(_STAUBLI_LINES, values, strict=True))
    return comments("//", head) + "".join(lines)


def from_staubli(text: str) -> PayloadBody:
    """Read a Staubli tool's load; raise ValueError for any other text."""
    values = np.array(
        [
            float(find_match(rf"(?m)^{name}\s*=\s*{NUMBER}\s*$", text, name).group(1))
            for name in _STAUBLI_LINES
        ]
    )
    values[1:4] /= 1e3
    return PayloadBody.of_reported(values)


# URDF: a separate link; its inertia is about the centre of gravity, in the frame of <inertial>.


def to_urdf(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write a URDF link."""
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    values = dict(zip(names, body.reported[4:], strict=True))
    order = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    inertia = " ".join(f'{name}="{digits(values[name])}"' for name in order)
    centre = " ".join(digits(x) for x in body.centre_m)
    about = "; ".join(
        (*origin, "kg, m, kg m^2; inertia about the centre of gravity, axes of the flange")
    ).replace("--", "- -")
    return (
        '<?xml version="1.0"?>\n'
        f"<!-- {about} -->\n"
        '<robot name="payload">\n'
        '  <link name="flange"/>\n'
        '  <joint name="flange_to_payload" type="fixed">\n'
        '    <parent link="flange"/>\n'
        '    <child link="payload"/>\n'
        '    <origin xyz="0 0 0" rpy="0 0 0"/>\n'
        "  </joint>\n"
        '  <link name="payload">\n'
        "    <inertial>\n"
        f'      <origin xyz="{centre}" rpy="0 0 0"/>\n'
        f'      <mass value="{digits(body.mass_kg)}"/>\n'
        f"      <inertia {inertia}/>\n"
        "    </inertial>\n"
        "  </link>\n"
        "</robot>\n"
    )


def from_urdf(text: str) -> PayloadBody:
    """Read a URDF link; raise ValueError for any other text."""
    inside = find_match(
        r'(?s)<link name="payload">\s*<inertial>(.*?)</inertial>', text, "link payload"
    ).group(1)
    xyz = find_match(r'<origin xyz="([^"]*)" rpy="([^"]*)"', inside, "origin")
    rpy = [float(angle) for angle in xyz.group(2).split()]
    axes = rotation_of_rpy(*rpy)
    mass = float(find_match(rf'<mass value="{NUMBER}"', inside, "mass").group(1))
    xx, yy, zz, xy, xz, yz = (
        float(find_match(rf'{name}="{NUMBER}"', inside, name).group(1))
        for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turned = axes @ inertia @ axes.T
    centre = np.array([float(x) for x in xyz.group(1).split()])
    return PayloadBody(mass, centre, (turned + turned.T) / 2.0)
