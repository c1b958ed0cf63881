"""Identified parameters as tables for other programs: CSV with one row per value, and JSON."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any, Literal

import numpy as np

from config.arrays import FloatArray
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.export.text import friction_units

Kind = Literal["identified", "shape", "warming", "consistent", "link"]

_HEAT = (
    "time constant T in T x' = P - x with P = (fc_heat + fv_heat |v|) |v|; v is the speed of the"
    " joint (of its actuator in a coupled wrist); x is 0 for a cold robot, with 1 K per watt; fcT"
    " and fvT multiply x"
)


@dataclass(frozen=True)
class TableRow:
    """One value of the table.

    `kind` is one of:
    - "identified": a base parameter,
    - "shape": a nonlinear parameter, such as a Stribeck speed or an efficiency,
    - "warming": a parameter of a joint's temperature that was not measured,
    - "consistent": a standard parameter of the physically consistent estimate,
    - "link": a property of a link about its centre of gravity.

    `words` is the combination of standard parameters. Sigmas are standard deviations; None if
    unknown.
    """

    kind: Kind
    name: str
    words: str
    value: float
    unit: str
    sigma: float | None = None
    sigma_noise: float | None = None
    sigma_residual: float | None = None


def parameter_rows(
    estimate: Estimate, consistent: ExportModel | None = None
) -> tuple[TableRow, ...]:
    """Return every identified value and, if given, the physically consistent ones.

    Args:
        estimate: The identified parameters.
        consistent: The physically consistent standard parameters.
    """
    base, noise, model = estimate.base, estimate.sigma_noise, estimate.model
    rows = [
        TableRow(
            "identified",
            base.names[i],
            base.expressions[i],
            float(estimate.values[i]),
            base.units[i],
            float(estimate.sigma[i]),
            None if noise is None else float(noise[i]),
            float(estimate.sigma_residual[i]),
        )
        for i in range(len(base))
    ]
    shapes = zip(
        model.nonlinear_names,
        model.nonlinear_values,
        model.nonlinear_units,
        estimate.nonlinear_sigma,
        strict=False,
    )
    rows += [
        TableRow("shape", name, name, float(value), unit, float(sigma))
        for name, value, unit, sigma in shapes
    ]
    rows += _warming_rows(estimate)
    if consistent is not None:
        own = consistent.model
        rows += [
            TableRow("consistent", name, name, float(value), unit)
            for name, value, unit in zip(
                own.parameter_names, consistent.parameters, own.parameter_units, strict=True
            )
        ]
        for number in range(1, own.chain.n + 1):
            rows += _link_rows(consistent, number)
    return tuple(rows)


def csv_table(estimate: Estimate, consistent: ExportModel | None = None) -> str:
    """Return the table as CSV (RFC 4180): one header row, decimal points, empty if unknown."""
    text = io.StringIO()
    names = list(TableRow.__dataclass_fields__)
    writer = csv.DictWriter(text, names, lineterminator="\r\n")
    writer.writeheader()
    for row in parameter_rows(estimate, consistent):
        values = asdict(row)
        writer.writerow(
            {k: repr(v) if isinstance(v, float) else _text(v) for k, v in values.items()}
        )
    return text.getvalue()


def _text(value: str | None) -> str | None:
    """Return a text that spreadsheets do not interpret as a formula."""
    return f"'{value}" if value and value[0] in "=+-@\t\r" else value


def json_table(estimate: Estimate, consistent: ExportModel | None = None) -> str:
    """Return the table as JSON, with the robot, the origin of the values and their quality.

    It is not the model file that other commands read, which is complete. This table is for users
    and programs that need only the numbers.
    """
    document: dict[str, Any] = {
        "kind": "rid-daq parameters",
        "software": f"rid-daq {version('rid-daq')}",
        "robot": estimate.robot.name,
        "joints": list(estimate.robot.joint_names),
        "cell": estimate.cell_name,
        "runs": list(estimate.run_ids),
        "condition_number": estimate.condition_number,
        "residual_nm": estimate.residual_nm.tolist(),
        "unseen": list(estimate.base.unseen),
        "consistency": None
        if consistent is None or consistent.test is None
        else asdict(consistent.test),
        "parameters": [asdict(row) for row in parameter_rows(estimate, consistent)],
    }
    return json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def _warming_rows(estimate: Estimate) -> list[TableRow]:
    """Return rows for the parameters of the computed temperatures that `fcT` and `fvT` multiply."""
    warming = estimate.warming
    if warming is None:
        return []
    rows = []
    for j in np.flatnonzero(warming.joints):
        joint = estimate.robot.joints[j]
        coulomb, viscous = friction_units(joint)
        sigma_s = float(warming.time_constant_sigma_s[j])
        for name, words, value, unit, sigma in (
            ("T_heat", _HEAT, warming.time_constant_s[j], "s", sigma_s),
            (
                "fc_heat",
                "Coulomb friction that heats the joint",
                warming.coulomb_nm[j],
                coulomb,
                None,
            ),
            (
                "fv_heat",
                "viscous friction that heats the joint",
                warming.viscous_nm_s[j],
                viscous,
                None,
            ),
            ("T0_heat", "temperature at x = 0", joint.reference_temperature_k, "K", None),
        ):
            own = f"{name}_{joint.name}"
            rows.append(TableRow("warming", own, words, float(value), unit, sigma))
    return rows


def _link_rows(model: ExportModel, number: int) -> list[TableRow]:
    link = model.links[number - 1]
    tensor: FloatArray = link.inertia_kg_m2[np.triu_indices(3)]
    values = [link.mass_kg, *link.centre_m, *tensor]
    names = ("mass", "centre_x", "centre_y", "centre_z", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    units = ("kg", *("m",) * 3, *("kg m^2",) * 6)
    assert len(values) == PARAMETERS_PER_LINK
    return [
        TableRow("link", f"link{number}.{name}", f"{name} of link {number}", float(value), unit)
        for name, value, unit in zip(names, values, units, strict=True)
    ]
