"""Exported inverse dynamics, compiled or imported, compared with the torques of the model."""

from __future__ import annotations

import ctypes
import importlib.util
import re
import shutil
import subprocess
from pathlib import Path
from types import ModuleType
from typing import TypedDict

import numpy as np
import pytest

from config.robot.friction_terms import FrictionTerm
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import GravitySpring, Joint, JointLimits, RobotDescription, Rotor
from dynamics.model.robot_model import torque
from dynamics.terms.conditions import Conditions
from identification.export.function import c_function, python_function
from identification.export.model import ExportModel
from identification.model.options import ModelOptions

COMPILER = shutil.which("cc") or shutil.which("gcc")


class Features(TypedDict):
    friction: list[tuple[FrictionTerm, ...]]
    efficiency: list[float | None]
    armature: list[bool]
    rotor: list[int | None]


LIMITS = JointLimits(
    position_min=-3.0, position_max=3.0, velocity=3.0, acceleration=9.0, torque=99.0
)
EVERYTHING: Features = {
    "friction": [
        ("asymmetric", "viscous", "temperature"),
        ("coulomb", "viscous", "stribeck", "shear_thinning", "load"),
        ("coulomb", "viscous", "offset", "cubic"),
        ("coulomb", "cube_root"),
    ],
    "efficiency": [0.8, None, 0.9, None],
    "armature": [False, True, False, False],
    "rotor": [0, None, 3, 2],
}


def robot(
    seed: int,
    kinds: str,
    *,
    features: Features | None = None,
    spring: GravitySpring | None = None,
    coupling: tuple[tuple[float, ...], ...] | None = None,
) -> RobotDescription:
    rng = np.random.default_rng(seed)

    def rotor(number: int, link: int | None) -> Rotor | None:
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        return None if link is None else Rotor(link=min(link, number), axis=tuple(axis.tolist()))

    n = len(kinds)
    features = features or {
        "friction": [("coulomb", "viscous")] * n,
        "efficiency": [None] * n,
        "armature": [False] * n,
        "rotor": [None] * n,
    }
    return RobotDescription(
        name="arm-7.b",
        gravity_m_s2=tuple(rng.uniform(-9.0, 9.0, 3).tolist()),
        kinematics=Kinematics(
            convention="modified_dh",
            rows=tuple(
                KinematicRow(
                    alpha_rad=rng.uniform(-3, 3),
                    beta_rad=rng.uniform(-0.3, 0.3),
                    theta_rad=rng.uniform(-3, 3),
                    a_m=rng.uniform(-0.5, 0.5),
                    d_m=rng.uniform(-0.5, 0.5),
                )
                for _ in kinds
            ),
        ),
        joints=tuple(
            Joint(
                name=f"j{i + 1}",
                type="prismatic" if kind == "P" else "revolute",
                limits=LIMITS,
                gear_ratio=-7.5 if i % 2 else 11.0,
                friction=features["friction"][i],
                efficiency=features["efficiency"][i],
                armature=features["armature"][i],
                rotor=rotor(i + 1, features["rotor"][i]),
            )
            for i, kind in enumerate(kinds)
        ),
        spring=spring,
        coupling=coupling,
    )


COUPLING = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, -0.4, 1.1))
PHYSICAL = GravitySpring(joint="j2", l_m=0.488, r_m=0.1)
FOURIER = GravitySpring(joint="j4", form="fourier")
CASES = {
    "links": (robot(1, "RRP"), ModelOptions(friction=False)),
    "one joint": (robot(2, "R"), ModelOptions()),
    "everything": (robot(3, "RRPR", features=EVERYTHING, spring=PHYSICAL), ModelOptions()),
    "coupled": (
        robot(4, "RRRR", features=EVERYTHING, spring=FOURIER, coupling=COUPLING),
        ModelOptions(sign_smoothing_rad_s=0.07, payload=True),
    ),
    "smooth": (robot(5, "RR"), ModelOptions(sign_smoothing_rad_s=0.1)),
    "payload": (robot(6, "RPR"), ModelOptions(payload=True)),
}


def case(name: str) -> tuple[ExportModel, np.ndarray, Conditions]:
    """Return a model with random parameters, a random motion, and its temperatures and payload."""
    description, options = CASES[name]
    model = options.build(description)
    rng = np.random.default_rng(7)
    values = rng.uniform(-2.0, 2.0, len(model.parameter_names))
    motion = rng.uniform(-2.0, 2.0, (3, 40, model.chain.n))
    motion[1, 0] = 0.0  # at rest the sign functions are zero
    warmth = rng.uniform(280.0, 320.0, motion.shape[1:])
    conditions = Conditions(temperature_k=warmth, payload=options.payload)
    return (
        ExportModel(description, model, values, ('runs 1 and 2 */ -- """ \\',)),
        motion,
        conditions,
    )


def expected(model: ExportModel, motion: np.ndarray, conditions: Conditions) -> np.ndarray:
    q, v, a = motion
    return torque(model.model, q, v, a, model.parameters, conditions)


@pytest.mark.parametrize("name", CASES)
def test_the_python_file_computes_the_models_torques(name: str, tmp_path: Path) -> None:
    model, motion, conditions = case(name)
    path = tmp_path / "exported.py"
    path.write_text(python_function(model))
    module = load(path)
    more: dict[str, object] = {}
    if "temperature_k" in path.read_text():
        more["temperature_k"] = conditions.temperature_k
    if conditions.payload:
        more["payload"] = True
    tau = module.inverse_dynamics(*motion, **more)
    np.testing.assert_allclose(tau, expected(model, motion, conditions), rtol=1e-9, atol=1e-9)
    if not more:
        one = module.inverse_dynamics(*motion[:, 5])
        np.testing.assert_allclose(one, tau[5], rtol=1e-12, atol=1e-12)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", CASES)
def test_the_c_file_computes_the_models_torques(name: str, tmp_path: Path) -> None:
    assert COMPILER is not None
    model, motion, conditions = case(name)
    source, library = tmp_path / "exported.c", tmp_path / "exported.so"
    source.write_text(c_function(model))
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wmissing-prototypes"]
    command = [COMPILER, *strict, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
    subprocess.run(command, check=True)
    function = ctypes.CDLL(str(library)).arm_7_b_inverse_dynamics
    declared = re.search(r"_inverse_dynamics\((.*?)\);", source.read_text(), re.DOTALL)
    assert declared is not None
    signature = declared[1]

    def row(values: np.ndarray) -> ctypes.Array[ctypes.c_double]:
        return (ctypes.c_double * len(values))(*values)

    tau = np.empty_like(motion[0])
    for s in range(len(tau)):
        arguments: list[ctypes.Array[ctypes.c_double] | ctypes.c_int]
        arguments = [row(x) for x in motion[:, s]]
        if "temperature_k" in signature:
            assert conditions.temperature_k is not None
            arguments.append(row(conditions.temperature_k[s]))
        if "int payload" in signature:
            arguments.append(ctypes.c_int(1))
        out = row(np.zeros(tau.shape[1]))
        function(*arguments, out)
        tau[s] = out
    np.testing.assert_allclose(tau, expected(model, motion, conditions), rtol=1e-9, atol=1e-9)


def test_no_text_of_the_origin_can_end_a_comment() -> None:
    model, _, _ = case("links")
    head = c_function(model).partition("#include")[0]
    assert head.count("*/") == 1
    assert python_function(model).partition("import numpy")[0].count('"""') == 2


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("exported", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
