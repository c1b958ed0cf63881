"""A payload's section of `result.json`, its verdict, and what is said of it on the console."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from identification.payload.body import REPORTED, REPORTED_UNITS
from identification.payload.estimate import PayloadEstimate
from identification.payload.findings import payload_findings
from identification.payload.verdict import PayloadResult, Repeats
from rid_daq.report.render import number
from rid_daq.report.result import verdict
from rid_daq.report.sections import units
from rid_daq.terminal.console import Console

_WORDS = {
    "together": "Robot and payload estimated together from runs with and without it",
    "difference": "Torques of the same motion with and without the payload, subtracted",
    "model": "Runs with the payload, less the model of the unloaded robot",
    "apart": "The robot identified with the payload and without, and subtracted",
}


def payload_section(payload: PayloadResult, repeats: Repeats | None) -> dict[str, Any]:
    """Return a payload with its intervals, principal axes, findings and torques."""
    estimate = payload.estimate
    known = {quantity.name: quantity.sigma for quantity in estimate.known}
    section: dict[str, Any] = {
        "sentence": _sentence(estimate),
        "procedure": estimate.procedure,
        "equations": estimate.equations,
        "condition_number": estimate.condition_number,
        "rank": estimate.rank,
        "parameters": [
            {
                "name": name,
                "unit": unit,
                "value": float(estimate.reported[i]) if estimate.seen[i] else None,
                "std": float(estimate.sigma[i]) if estimate.seen[i] else None,
                "std_noise": float(estimate.sigma_noise[i]) if estimate.seen[i] else None,
                "known": name in known,
            }
            for i, (name, unit) in enumerate(zip(REPORTED, REPORTED_UNITS, strict=True))
        ],
        "principal": None,
        "repeats": None,
        "findings": [f"{finding.sentence}." for finding in payload_findings(estimate)],
        "axes": [
            {
                "joint": joint.name,
                "unit": units(joint)[1],
                "payload": float(estimate.payload_nm[j]),
                "residual": float(estimate.residual_nm[j]),
                "mass_per_percent": 0.01 * float(estimate.gain_effects[0, j]),
            }
            for j, joint in enumerate(estimate.robot.joints)
        ],
    }
    if estimate.rank == len(estimate.values):
        moments, axes = estimate.body.principal
        section["principal"] = [
            {"moment": float(moment), "axis": [float(x) for x in axis]}
            for moment, axis in zip(moments, axes.T, strict=True)
        ]
        p = estimate.consistent[1]
        for entry, value in zip(section["parameters"], estimate.body.reported, strict=True):
            entry["exported"] = float(value)
        section["existence"] = (
            "A body with these parameters can exist."
            if p == 1.0
            else f"No body has exactly these parameters; the closest one that can exist"
            f" {'explains' if estimate.can_exist else 'DOES NOT explain'} the data (p = {p:.2g})."
        )
    if repeats is not None:
        section["repeats"] = {
            "runs": len(repeats.values),
            "ratio": repeats.ratio,
            "scatter": [float(x) for x in repeats.scatter],
        }
    return section


def payload_verdict(payload: PayloadResult) -> dict[str, Any]:
    """Return the verdict section of a payload."""
    estimate = payload.estimate
    lines = [{**asdict(line), "passed": line.passed} for line in payload.checks]
    lines = [
        {**line, "value": float(line["value"]), "limit": float(line["limit"])} for line in lines
    ]
    failed = [line["text"] for line in lines if not line["passed"]]
    mass = (
        f"{estimate.reported[0]:.3f} kg ± {2 * estimate.sigma[0]:.2g} kg (2σ)"
        if estimate.seen[0]
        else "a mass that this motion does not show"
    )
    headline = (
        f"Failed: {'; '.join(failed)}"
        if failed
        else f"Passed: the payload has {mass.split(' (')[0]}"
    )
    sentence = f"Mass: {mass}. Load data are exported where this verdict is passed."
    return verdict(lines, headline, sentence)


def tell_payload(console: Console, section: dict[str, Any]) -> None:
    """Say what a payload's section holds."""
    console.say(section["sentence"])
    console.table(
        ("parameter", "estimate", "± 2σ", "unit", ""),
        [
            (
                entry["name"],
                "not seen" if entry["value"] is None else number(entry["value"], 5),
                "–" if entry["std"] is None else number(2.0 * entry["std"], 2),
                entry["unit"],
                "known" if entry["known"] else "",
            )
            for entry in section["parameters"]
        ],
    )
    console.say("Centre of gravity from the flange, inertia about it, in the flange's axes.")
    if section["principal"] is not None:
        console.say(
            "Principal moments [kg m^2] about: "
            + "; ".join(
                f"{number(each['moment'], 4)} about ({', '.join(f'{x:.3f}' for x in each['axis'])})"
                for each in section["principal"]
            )
        )
        console.say(section["existence"])
    if section["repeats"] is not None:
        repeats = section["repeats"]
        console.say(
            f"{repeats['runs']} runs, each for itself: mass scatters by {repeats['scatter'][0]:.3g}"
            f" kg (1σ); scatter over quoted standard deviation, all ten: {repeats['ratio']:.2f}."
        )
    for finding in section["findings"]:
        console.say(finding)
    console.table(
        ("axis", "torque of the payload (RMS)", "left over (RMS)", "mass per 1 % of torque"),
        [
            (
                axis["joint"],
                f"{number(axis['payload'], 3)} {axis['unit']}",
                f"{number(axis['residual'], 3)} {axis['unit']}",
                f"{number(axis['mass_per_percent'], 2)} kg",
            )
            for axis in section["axes"]
        ],
    )


def _sentence(estimate: PayloadEstimate) -> str:
    held = ", ".join(f"{k.name} = {k.value:g} ± {2 * k.sigma:.2g} (2σ)" for k in estimate.known)
    return (
        f"{_WORDS[estimate.procedure]}: {estimate.equations} equations, friction free in each run,"
        f" condition number {estimate.condition_number:.3g}"
        + (f"; known: {held}." if held else ".")
    )
