"""`page_text`: the page `docs/thesis.md`, from the thesis's numbers and our results."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Final

import jinja2
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.thesis.records import Tree
from benchmarks.thesis.relations import PLATE_MODELS, Relation, relations
from identification.choices import REPORTED

Row = Sequence[str | float]

TEMPLATE: Final = Path(__file__).with_name("page.md.j2")
UNITS: Final = ("kg", "mm", "mm", "mm", *("kg m²",) * 6)
SCALES: Final = (1.0, 1e3, 1e3, 1e3, *(1.0,) * 6)
"""Factors from SI units to `UNITS`."""

HUNDRED: Final = 100.0
LINE: Final = 120
"""Longest line of a paragraph."""


def page_text(facts: Tree, results: Tree) -> str:
    """Return the page in Markdown."""
    found = relations(facts, results)
    template = jinja2.Template(
        TEMPLATE.read_text(encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    page: str = template.render(
        facts=facts,
        results=results,
        relations=found,
        joined=joined,
        duration=duration_text(results),
        holds=lambda section: relation_lines(found, section),
        **robot_tables(facts, results["robot"]),
        **payload_tables(facts, results["payload"], results["sensitivity"]),
        **path_tables(facts, results["path"]),
        friction_table=friction_table(results["friction"]),
        warming_table=warming_table(facts["series_axes"], results["warming"]),
        best_friction=min(
            results["friction"]["warm"]["axis6"]["rms_nm"].items(), key=itemgetter(1)
        ),
    )
    return "\n\n".join(wrapped(block) for block in re.split(r"\n{2,}", page.strip())) + "\n"


def wrapped(block: str) -> str:
    """Return a paragraph or a list with short lines; other blocks do not change."""
    if block.startswith(("#", "|", "!")):
        return block
    return "\n".join(
        textwrap.fill(
            " ".join(item.split()),
            LINE,
            subsequent_indent="  " if item.startswith("- ") else "",
            break_long_words=False,
            break_on_hyphens=False,
        )
        for item in re.split(r"\n(?=- )", block)
    )


def duration_text(results: Tree) -> str:
    """Return sentences with the durations of the parts, and the short parts."""
    minutes = ", ".join(f"{name} {each:g}" for name, each in results["minutes"].items())
    text = f"Measured durations of parts, in minutes: {minutes}."
    if results["short"]:
        text += (
            f" These parts were short experiments (`--quick`): {', '.join(results['short'])}. Their"
            " means contain more noise. Errors of short payload experiments are not compared with"
            " the thesis's limits."
        )
    return text


def relation_lines(found: Sequence[Relation], section: str) -> str:
    """Return the relations of a section as a list, with the causes of differences."""
    return "\n".join(
        f"- Holds: {each.text}"
        if each.holds
        else f"- **Does not hold**: {each.text} {each.reason}".rstrip()
        for each in found
        if each.section == section
    )


def table(head: Sequence[str], *rows: Row) -> str:
    """Return a table in Markdown."""
    lines = [tuple(head), ("---",) * len(head), *rows]
    return "\n".join(
        f"| {' | '.join(c if isinstance(c, str) else f'{c:.4g}' for c in line)} |" for line in lines
    )


def joined(values: Sequence[float]) -> str:
    """Return numbers as one text, separated by commas."""
    return ", ".join(f"{each:.4g}" for each in values)


def robot_tables(facts: Tree, robot: Tree) -> dict[str, str]:
    """Return the tables of chapters 3 and 4."""
    theirs, plate = facts["robot_torque"], facts["plate_torque"]
    head = ("model", "thesis", "ours, excitation", "ours, random points")

    def ours(model: str) -> tuple[str, str]:
        return joined(robot[model]["excitation_nm"]), joined(robot[model]["points_nm"])

    return {
        "robot_table": table(
            head,
            ("reference model", joined(theirs["reference_nm"]), *ours("internal")),
            (
                "without rotor inertia",
                joined(theirs["without_rotors_nm"]),
                *ours("without_rotors"),
            ),
            ("calibrated kinematics", joined(theirs["calibrated_nm"]), *ours("calibrated")),
        ),
        "deviation_table": table(
            ("parameter", "unit", "internal (torques)", "external (plate)", "combined"),
            *((each["words"], each["unit"], *each["std"]) for each in robot["deviations"]),
        ),
        "plate_table": table(
            head,
            *(
                (name, joined(plate[f"{name}_nm"]), *ours(name))
                for name in ("internal", "combined")
            ),
        ),
        "excitation_wrench_table": wrench_table(
            (
                name,
                robot[name]["excitation_wrench"]["rms"],
                robot[name]["excitation_wrench"]["percent"],
            )
            for name in PLATE_MODELS
        ),
        "wrench_table": wrench_table(
            (name, robot[name]["wrench"], robot[name]["wrench_percent"]) for name in PLATE_MODELS
        ),
    }


def wrench_table(models: Iterable[tuple[str, Sequence[float], Sequence[float]]]) -> str:
    """Return the errors of the base wrench of some models, absolute and in percent."""
    return table(
        ("model", "Fx [N]", "Fy [N]", "Fz [N]", "Mx [N m]", "My [N m]", "Mz [N m]"),
        *(
            (name, *(f"{e:.3g} ({p:.2g} %)" for e, p in zip(errors, percent, strict=True)))
            for name, errors, percent in models
        ),
    )


def friction_table(friction: Tree) -> str:
    """Return the errors of the friction models of axis 6, the best first."""
    errors = friction["warm"]["axis6"]["rms_nm"]
    return table(("model", "error [N m]"), *sorted(errors.items(), key=itemgetter(1)))


def payload_tables(facts: Tree, payload: Tree, sensitivity: Tree) -> dict[str, str]:
    """Return the tables of chapter 5."""
    names = [f"{name} [{unit}]" for name, unit in zip(REPORTED, UNITS, strict=True)]
    masses = [each["values"][0] for each in _experiments(payload, "medium", "model")]
    counts = [
        f"{len(_experiments(payload, name, 'difference'))} with the {name}"
        for name in _payloads(payload)
    ]
    return {
        "payload_friction_table": table(
            ("friction", *(f"axis {j}" for j in range(1, 7))),
            *(
                (f"{words}, {who}", *source[key])
                for key, words in (
                    ("coulomb_nm", "Coulomb [N m]"),
                    ("viscous_nm_s", "viscous [N m s/rad]"),
                )
                for who, source in (("thesis", facts["friction"]), ("ours", payload["friction"]))
            ),
        ),
        "sensitivity_table": table(
            ("wrong assumption", "", *REPORTED), *_sensitivity_rows(facts, sensitivity)
        ),
        "unnamed_table": table(
            ("row", *REPORTED),
            *(
                (case, *map(_percent, theirs))
                for case, theirs in facts["sensitivity"]["unnamed"].items()
            ),
        ),
        "prediction_table": table(
            ("wrong assumption", "torque error [%]"),
            *((case, _percent(max(row["torque_percent"]))) for case, row in sensitivity.items()),
        ),
        "experiments": f"{', '.join(counts[:-1])} and {counts[-1]}",
        "difference_table": table(("payload", *names), *_payload_rows(payload, "difference")),
        "model_table": table(("payload", *names), *_payload_rows(payload, "model")),
        "model_masses": " to ".join(dict.fromkeys(f"{f(masses):.2f}" for f in (min, max))),
        "other_motion_table": table(
            ("payload estimated with", *(f"axis {j}" for j in range(3, 7))),
            *(
                (words, *_with_torque(payload[key]))
                for words, key in (
                    ("a second run", "other_difference"),
                    ("a modelled robot", "other_model"),
                )
            ),
        ),
    }


def warming_table(theirs: Tree, series: Tree) -> str:
    """Return the ranges of friction and payload in a series of measurements, from cold motors."""
    sources = (theirs, series["cold"], series["corrected"])
    friction = [
        (f"{words}, axis {3 + row}", *(_range(source[key][row]) for source in sources))
        for key, words in (
            ("coulomb_nm", "Coulomb friction [N m]"),
            ("viscous_nm_s", "viscous friction [N m s/rad]"),
        )
        for row in range(len(theirs[key]))
    ]
    payload = [
        (
            f"{name} [{unit}]",
            *(_range(scale * np.array(source["values"][row])) for source in sources),
        )
        for row, (name, unit, scale) in enumerate(zip(REPORTED, UNITS, SCALES, strict=True))
    ]
    head = ("", "thesis, axis of the figure", "ours", "ours, corrected torque constants")
    return table(head, *friction, *payload)


def path_tables(facts: Tree, path: Tree) -> dict[str, str]:
    """Return the tables of chapter 6."""
    theirs, peaks = facts["path"], facts["joint_peaks"]
    plain, ours, chosen = (path[f"circle_{key}"] for key in ("plain", "classical", "chosen"))
    rows = (
        ("ours, without", plain),
        ("ours, with compensation; Coulomb and viscous friction", ours),
        ("ours, with compensation; friction terms chosen by the program", chosen),
        ("ours, vertical circle of 30 cm at 0.5 m/s, without compensation", path["other_plain"]),
        (
            "ours, vertical circle, with compensation; Coulomb and viscous friction",
            path["other_classical"],
        ),
        ("ours, vertical circle, with compensation; chosen friction terms", path["other_chosen"]),
    )
    return {
        "main_table": table(
            (
                "path error [mm]",
                "thesis",
                "ours, friction terms of the thesis",
                "ours, chosen terms",
            ),
            *(
                (words, theirs[f"{when}_{key}"], one[key], other[key])
                for words, when, key, one, other in (
                    ("mean, without compensation", "plain", "mean_mm", plain, plain),
                    ("mean, with compensation", "compensated", "mean_mm", ours, chosen),
                    ("largest, without compensation", "plain", "max_mm", plain, plain),
                    ("largest, with compensation", "compensated", "max_mm", ours, chosen),
                )
            ),
        ),
        "joint_table": table(
            ("", "thesis, largest axis", "ours, axes 1 to 3"),
            (
                "without compensation",
                f"about {peaks['plain_mrad']:g}",
                joined(plain["peaks_mrad"]),
            ),
            (
                "with compensation",
                f"about {peaks['compensated_mrad']:g}",
                joined(ours["peaks_mrad"]),
            ),
        ),
        "path_table": table(
            ("path error [mm]", "mean", "largest"),
            ("thesis, without", theirs["plain_mean_mm"], theirs["plain_max_mm"]),
            ("thesis, with", theirs["compensated_mean_mm"], theirs["compensated_max_mm"]),
            *((words, each["mean_mm"], each["max_mm"]) for words, each in rows),
        ),
    }


def _range(values: ArrayLike) -> str:
    return f"{np.min(values):.4g} to {np.max(values):.4g}"


def _with_torque(found: Tree) -> list[str]:
    pairs = zip(found["error_nm"], found["torque_nm"], strict=True)
    return [f"{error:.3g} of {torque:.3g}" for error, torque in pairs]


def _sensitivity_rows(facts: Tree, sensitivity: Tree) -> Iterator[Row]:
    for case, theirs in facts["sensitivity"]["rows"].items():
        yield (case, "thesis", *map(_percent, theirs))
        yield ("", "ours", *map(_percent, sensitivity[case]["percent"]))


def _payloads(payload: Tree) -> list[str]:
    return list(dict.fromkeys(each["payload"] for each in payload["experiments"]))


def _experiments(payload: Tree, name: str, procedure: str) -> list[Tree]:
    wanted = (name, procedure)
    return [e for e in payload["experiments"] if (e["payload"], e["procedure"]) == wanted]


def _payload_rows(payload: Tree, procedure: str) -> Iterator[Row]:
    """Yield the largest errors of each payload, with the mean standard deviations."""
    for name in _payloads(payload):
        own = _experiments(payload, name, procedure)
        errors = np.abs([each["errors"] for each in own]).max(axis=0) * SCALES
        std = np.mean([each["std"] for each in own], axis=0) * SCALES
        yield (name, *(f"{e:.2g} ({s:.2g})" for e, s in zip(errors, std, strict=True)))


def _percent(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}" if abs(value) < HUNDRED else f"{value:.0f}"
