"""Inverse dynamics as a self-contained C99 or Python file.

The file has every term of the model except presliding: its friction follows the sign of the speed.

The recursion is that of the thesis's appendix B, with the values of the standard parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from dynamics.terms.friction import Friction, FrictionColumn
from dynamics.terms.friction_functions import unknown_function
from dynamics.terms.payload import Payload
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from dynamics.terms.rotors import Rotors
from dynamics.terms.spring import Spring
from identification.export.model import ExportModel
from identification.export.text import (
    comment_text,
    header_lines,
    render,
    source_name,
    temperature_lines,
)

Language = Literal["c", "python"]

# The names of the functions in each language.
_C = {"sign": "sign", "smooth": "smooth_sign", "abs": "fabs", "exp": "exp", "cbrt": "cbrt",
      "asinh": "asinh", "sin": "sin", "cos": "cos", "sqrt": "sqrt", "pow": "pow"}  # fmt: skip
_PYTHON = {"sign": "np.sign", "smooth": "_smooth_sign", "abs": "np.abs", "exp": "np.exp",
           "asinh": "np.arcsinh", "cbrt": "np.cbrt", "sin": "np.sin", "cos": "np.cos",
           "sqrt": "np.sqrt", "pow": "np.power"}  # fmt: skip


@dataclass(frozen=True)
class _Line:
    """One summand of a joint's or actuator's torque, as an expression."""

    joint: int
    text: str
    words: str


def c_function(model: ExportModel) -> str:
    """Return a C99 file with `<robot>_inverse_dynamics(q, v, a, torque)`."""
    return _render("inverse_dynamics.c.j2", model, "c")


def python_function(model: ExportModel) -> str:
    """Return a Python file with `inverse_dynamics(q, v, a)`, for one sample or many."""
    return _render("inverse_dynamics.py.j2", model, "python")


def _render(template: str, model: ExportModel, language: Language) -> str:
    chain, coupling = model.model.chain, model.model.coupling
    n = chain.n
    lines = [*_armatures(model, language), *_friction(model, language)]
    losses = _losses(model, language)
    text = " ".join(line.text for line in lines)
    payload = model.term(Payload)
    smooth = _names(language)["smooth"] in text
    warm = "temperature_k" in text
    return render(
        template,
        name=source_name(model.robot.name),
        head=(*header_lines(model), *(temperature_lines(model) if warm else ())),
        joints=model.robot.joint_names,
        n=n,
        fixed=chain.fixed_rotations,
        theta=chain.rows[:, 2],
        a=chain.rows[:, 3],
        d=chain.rows[:, 4],
        prismatic=[int(slides) for slides in chain.prismatic],
        gravity=chain.gravity_m_s2,
        links=model.parameters[: PARAMETERS_PER_LINK * n].reshape(n, PARAMETERS_PER_LINK),
        payload=payload is not None,
        payload_values=None if payload is None else payload[1],
        coupling=coupling is not None,
        coupling_matrix=None if coupling is None else coupling.joints_by_motors,
        coupling_inverse=None if coupling is None else coupling.motors_by_joints,
        rotors=_rotors(model),
        spring=_spring(model, language),
        losses=losses,
        actuator_lines=lines,
        warm=warm,
        smoothing=_smoothing(model),
        smooth_signs=smooth,
        signs=bool(losses) or " sign(" in f" {text}" or (smooth and not _smoothing(model)),
    )


def _names(language: Language) -> dict[str, str]:
    return _C if language == "c" else _PYTHON


def _at(array: str, joint: int, language: Language) -> str:
    return f"{array}[{joint}]" if language == "c" else f"{array}[:, {joint}]"


def _rotors(model: ExportModel) -> list[dict[str, Any]]:
    found = model.term(Rotors)
    if found is None:
        return []
    term, values = found
    return [
        {
            "joint": int(term.joint[k]),
            "joint_name": model.robot.joint_names[term.joint[k]],
            "link": int(term.link[k]),
            "axis": term.axis[k],
            "ratio": float(term.ratio[k]),
            "inertia": float(values[k]),
        }
        for k in range(len(values))
    ]


def _spring(model: ExportModel, language: Language) -> _Line | None:
    found = model.term(Spring)
    if found is None:
        return None
    term, values = found
    f, q = _names(language), _at("q", term.joint, language)
    if term.distances_m is None:
        parts = []
        for k in range(len(values) // 2):
            angle = f"{k + 1}.0 * {q}"
            parts.append(f"({float(values[2 * k])!r}) * {f['cos']}({angle})")
            parts.append(f"({float(values[2 * k + 1])!r}) * {f['sin']}({angle})")
        return _Line(term.joint, " + ".join(parts), "spring")
    near, far = term.distances_m[1], term.distances_m[0]
    stiffness, preload = (float(value) for value in values)
    length = f"{f['sqrt']}({far**2 + near**2!r} - {2.0 * far * near!r} * {f['cos']}({q}))"
    text = f"{far * near!r} * {f['sin']}({q}) * ({stiffness!r} - ({preload!r}) / {length})"
    return _Line(term.joint, text, "spring")


def _losses(model: ExportModel, language: Language) -> list[_Line]:
    f = _names(language)
    lines = []
    for loss in model.model.transmission.losses:
        s = f"{f['sign']}(carried * {_at('va', loss.joint, language)})"
        value = loss.parameter.value
        driven = f"{f['pow']}({value!r}, -{s})"
        text = driven if loss.kind == "efficiency" else f"(1.0 + {value!r} * {s})"
        lines.append(_Line(loss.joint, text, comment_text(loss.parameter.name)))
    return lines


def _armatures(model: ExportModel, language: Language) -> list[_Line]:
    lines = []
    for j, joint in enumerate(model.robot.joints):
        value = model.of(f"Ia{j + 1}")
        if value != 0.0:
            text = f"({value!r}) * {_at('aa', j, language)}"
            lines.append(_Line(j, text, f"armature of {joint.name}"))
    return lines


def _friction(model: ExportModel, language: Language) -> list[_Line]:
    found = model.term(Friction)
    if found is None:
        return []
    term, values = found
    lines = []
    for column, value in zip(term.columns, values, strict=True):
        text = f"({float(value)!r}) * {_friction_function(term, column, language)}"
        lines.append(_Line(column.joint, text, comment_text(column.parameter_name)))
    return lines


def _friction_function(term: Friction, column: FrictionColumn, language: Language) -> str:
    """Return the source text of the function that a friction coefficient multiplies."""
    f, u = _names(language), _at("va", column.joint, language)
    warmth = (
        f"({_at('temperature_k', column.joint, language)} - {column.reference_temperature_k!r})"
    )
    smooth = f"{f['smooth']}({u})"
    moving = "1.0" if term.sign_smoothing_rad_s else f"{f['abs']}({f['sign']}({u}))"
    match column.function:
        case "coulomb":
            return smooth
        case "viscous":
            return u
        case "offset":
            return "1.0"
        case "forward":
            return f"0.5 * ({smooth} + {moving})"
        case "backward":
            return f"0.5 * ({smooth} - {moving})"
        case "cubic":
            return f"{u} * {u} * {u}"
        case "cube_root":
            return f"{f['cbrt']}({u})"
        case "stribeck":
            speed = next(s.parameter.value for s in term.stribeck if s.joint == column.joint)
            return f"{smooth} * {f['exp']}(-{f['abs']}({u}) / {speed!r})"
        case "shear_thinning":
            speed = column.shear_thinning_speed
            return f"{speed!r} * {f['asinh']}({u} / {speed!r})"
        case "coulomb_by_temperature":
            return f"{smooth} * {warmth}"
        case "viscous_by_temperature":
            return f"{u} * {warmth}"
        case _:
            raise unknown_function(column.function, "identification/export/function.py")


def _smoothing(model: ExportModel) -> float:
    found = model.term(Friction)
    return 0.0 if found is None else found[0].sign_smoothing_rad_s
