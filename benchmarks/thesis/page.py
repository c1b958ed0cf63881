"""`page_text`: the page `docs/thesis.md`, from the thesis's numbers and our results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from benchmarks.thesis.records import Tree
from benchmarks.thesis.relations import relations
from identification.choices import REPORTED

AXES: Final = ("axis 1", "axis 2", "axis 3")
SIX: Final = (*AXES, "axis 4", "axis 5", "axis 6")
UNITS: Final = ("kg", "mm", "mm", "mm", *("kg m²",) * 6)


def page_text(facts: Tree, results: Tree) -> str:
    """Return the page in Markdown."""
    page = _Page(facts, results)
    return "\n".join(page.lines()).replace("\n\n\n", "\n\n").strip() + "\n"


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Return a table in Markdown."""
    cells = [[cell if isinstance(cell, str) else f"{cell:.4g}" for cell in row] for row in rows]
    return [
        "",
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *("| " + " | ".join(row) + " |" for row in cells),
        "",
    ]


class _Page:
    """The page's sections.

    Attributes:
        facts: Numbers of the thesis.
        results: Our results.
    """

    def __init__(self, facts: Tree, results: Tree) -> None:
        self.facts = facts
        self.results = results
        self._relations = relations(facts, results)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the page."""
        yield from self._head()
        yield from self._chapter_3()
        yield from self._friction()
        yield from self._chapter_4()
        yield from self._chapter_5()
        yield from self._chapter_6()

    def _holds(self, section: str) -> Iterator[str]:
        yield ""
        for each in self._relations:
            if each.section == section:
                yield f"- {'Holds' if each.holds else '**Does not hold**'}: {each.text}"
        yield ""

    def _head(self) -> Iterator[str]:
        holding = sum(each.holds for each in self._relations)
        path, facts = self.results["path"], self.facts["path"]
        circle = path["circle_plain"], path["circle_classical"], path["circle_chosen"]
        yield f"""# Comparison with the thesis

rid-daq follows Walter Verdonck, *Experimental robot and payload identification with application to dynamic trajectory
compensation*, K.U.Leuven, 2004. This page repeats the experiments of chapters 3 to 6 on simulated robots, and puts our
results beside the results of the thesis, figure by figure. `python -m benchmarks.thesis` runs the experiments and writes
this page, its pictures and `docs/thesis.json`. The last run took {self.results["elapsed_min"]:g} minutes. Of
{len(self._relations)} relations that the thesis states, {holding} hold. The command ends with exit code 1 if one does not.

The main result, on a circle of 40 cm diameter at 0.6 m/s (table 6.2):
"""
        yield from table(
            ("path error at the motor encoders", "thesis", "ours, same friction terms",
             "ours, terms chosen by the program"),
            [
                ("mean without compensation [mm]", facts["plain_mean_mm"], circle[0]["mean_mm"],
                 circle[0]["mean_mm"]),
                ("mean with compensation [mm]", facts["compensated_mean_mm"],
                 circle[1]["mean_mm"], circle[2]["mean_mm"]),
                ("largest without compensation [mm]", facts["plain_max_mm"],
                 circle[0]["max_mm"], circle[0]["max_mm"]),
                ("largest with compensation [mm]", facts["compensated_max_mm"],
                 circle[1]["max_mm"], circle[2]["max_mm"]),
            ],
        )  # fmt: skip
        yield """## What is compared

- **The thesis's numbers** are in `benchmarks/thesis/facts.yaml`. The available text of the thesis has lost its equations
  and most of its tables, so many tables have no numbers here: 3.3, 3.4, 4.1, 4.3, 4.5, 5.6 to 5.11. For them, the
  statements of the text are checked.
- **Our robots** are simulated. The simulation uses Pinocchio and not the equations of the estimators. Their links, rotors
  and gears are assumed, so absolute torques and parameters cannot agree. What can agree is the accuracy of an identified
  model, the effect of each choice, and the improvement of the path.
- **Chapters 3, 4 and 6** use the bundled cell `ir361_thesis`. Its unmodelled friction and its noise were set so that the
  torque errors of an identified model have the size of those of the thesis. The size of these errors is therefore
  no result. The cell's cycle of 6 ms gives the delay of 3 ms that the thesis reports; its control had 150 Hz.
- **Chapter 5** uses the bundled cell `kr15`, with the friction of table 5.1 and the payloads of table 5.5.
- **All path errors are measured at the motors**, in the thesis and here. They do not contain the deflection of gears and
  links. The error at the tool is larger than 0.25 mm in the thesis, by an amount that it did not measure.
"""

    def _chapter_3(self) -> Iterator[str]:
        robot, facts = self.results["robot"], self.facts["robot_torque"]
        own, theirs = robot["excitation"], self.facts["excitation"]
        crest = ", ".join(f"{each:.2f}" for each in own["velocity_crest"])
        yield f"""## Chapter 3: identification of the robot

### Figure 3.5: excitation trajectory

The thesis uses {theirs["harmonics"]} harmonics, a period of {theirs["period_s"]:g} s and {theirs["periods"]} periods. Ours
has the same number of harmonics and periods, and a period of 9.6 s, which is a whole number of cycles of 6 ms. Its
condition number is {own["condition"]:.4g}; the crest factors of the velocities are {crest}. The thesis's values of both
have not survived.

![Positions of the three axes over one period](pictures/thesis/excitation.svg)

### Base parameters
"""
        yield from self._holds("base")
        yield f"""Together with rotor 3, our internal model has {robot["internal"]["rigid"]} rigid-body parameters; the
external model, without the motors' side of the rotors, has {robot["external"]["rigid"]}.

### Tables 3.1 and 3.2: error of the predicted torque

The table shows RMS errors in N m. Our columns are for the excitation run (mean of all periods) and for a motion through
{self.facts["validation"]["points"]} random points, as in figure 3.6. The text does not show from which of both tables the
thesis's numbers are.
"""
        rows = []
        for words, key, name in (
            ("reference model", "reference_nm", "internal"),
            ("without rotor inertia", "without_rotors_nm", "without_rotors"),
            ("with calibrated kinematics", "calibrated_nm", "calibrated"),
        ):
            model = robot[name]
            rows.append(
                (words, *map(_list, (facts[key], model["excitation_nm"], model["points_nm"])))
            )
        yield from table(
            ("model", "thesis, axes 1 to 3", "ours, excitation", "ours, random points"), rows
        )
        yield from self._holds("rotors")
        yield from self._holds("kinematics")
        yield """**What differs, and why.** Our errors on the excitation run are smaller than those on the random points,
because the mean of 16 periods contains less noise and only frequencies up to 10 Hz. The effect of rotor 3 is larger,
because the assumed rotor of `ir361` is larger. As in the thesis, the calibrated rows move the tool by less than a
millimetre, which changes no torque noticeably.

### Figure 3.7: torque with and without rotor inertia

![Measured torque of the random points, and error of the prediction](pictures/thesis/torque.svg)

The error of axis 3 is visibly larger on the left, as in the thesis. Peaks at velocity reversals remain in all models: the
friction there is neither Coulomb nor viscous.
"""

    def _friction(self) -> Iterator[str]:
        found = self.results["friction"]
        yield """### Figures 3.9 to 3.12: friction

Axis ranges show that these figures are of the six-axis robot, so ours are of `kr15`. Motors start at 25 °C (cold) or at
42 °C (warm).

![Friction of axes 1, 4 and 6 over speed](pictures/thesis/friction.svg)
"""
        yield from self._holds("warm")
        yield from self._holds("loaded")
        rms = found["warm"]["axis6"]["rms_nm"]
        yield "RMS errors of friction models of axis 6, warm (figure 3.10):"
        yield from table(("model", "error [N m]"), sorted(rms.items(), key=lambda item: item[1]))
        yield """**What differs, and why.** In the thesis, viscous friction with the cube root of the speed fits better
than Coulomb with viscous friction. The friction of `kr15` is Coulomb, viscous and Stribeck friction with the coefficients
of table 5.1, so here the models with these terms fit best. The program compares all models, and selects one by its
criterion ([friction](guide/friction.md)).
"""

    def _chapter_4(self) -> Iterator[str]:
        robot, facts = self.results["robot"], self.facts["plate_torque"]
        yield """## Chapter 4: force plate and torques together

### Table 4.1: standard deviations of the parameters

The thesis's numbers have not survived. Our standard deviations from noise, for the parameters that both measurements
determine:
"""
        yield from table(
            ("parameter", "unit", "internal (torques)", "external (plate)", "combined"),
            [(each["words"], each["unit"], *each["std"]) for each in robot["deviations"]],
        )
        yield from self._holds("deviations")
        yield "### Tables 4.2 and 4.4: error of the predicted torque\n\nRMS errors in N m, axes 1 to 3:"
        yield from table(
            ("model", "thesis", "ours, excitation", "ours, random points"),
            [
                (name, _list(facts[f"{name}_nm"]), _list(robot[name]["excitation_nm"]),
                 _list(robot[name]["points_nm"]))
                for name in ("internal", "combined")
            ],
        )  # fmt: skip
        yield from self._holds("plate_torque")
        yield "### Tables 4.3 and 4.5, figure 4.5: error of the predicted reaction\n"
        yield "RMS errors on the random points (the thesis's numbers have not survived):"
        yield from table(
            ("model", "Fx [N]", "Fy [N]", "Fz [N]", "Mx [N m]", "My [N m]", "Mz [N m]"),
            [
                (name, *[f"{a:.3g} ({b:.2g} %)" for a, b in zip(
                    robot[name]["wrench"], robot[name]["wrench_percent"], strict=True)])
                for name in ("external", "combined")
            ],
        )  # fmt: skip
        yield from self._holds("wrench")
        yield """![Measured reaction of the random points, and error of the prediction](pictures/thesis/reaction.svg)
"""

    def _chapter_5(self) -> Iterator[str]:
        payload, facts = self.results["payload"], self.facts
        yield """## Chapter 5: payload

### Table 5.1: friction

The simulated friction has the values of the table. Our estimate is from an excitation of all axes with warm motors, whose
friction is smaller; Stribeck and load friction, which the model does not contain, increase the Coulomb friction.
"""
        yield from table(
            ("friction", *SIX),
            [
                (words, *source[key])
                for who, source in (("thesis", facts["friction"]), ("ours", payload["friction"]))
                for key, words in (
                    ("coulomb_nm", f"Coulomb [N m], {who}"),
                    ("viscous_nm_s", f"viscous [N m s/rad], {who}"),
                )
            ],
        )
        yield """### Table 5.3: wrong assumptions about the robot

Deviations of the medium payload's parameters in percent of the true values. The first line of a row is the thesis, the
second is ours (`rid-daq sensitivity kr15`).
"""
        yield from table(("wrong assumption", "", *REPORTED), list(self._sensitivity_rows()))
        yield from self._holds("mass")
        yield """**What differs, and why.** The thesis's motion, rotors, links and the sizes of its errors are unknown, and
the deviations depend on all of them. [The guide](guide/payload-sensitivity.md) discusses each row.

### Figure 5.4: predicted torque with wrong assumptions

The largest torque error of an axis on another motion, relative to the torque of the axis:
"""
        yield from table(
            ("wrong assumption", "torque error [%]"),
            [(case, max(row["torque_percent"])) for case, row in
             self.results["sensitivity"].items()],
        )  # fmt: skip
        yield from self._holds("prediction")
        yield from self._payload_tables(payload)

    def _sensitivity_rows(self) -> Iterator[Sequence[str]]:
        for case, theirs in self.facts["sensitivity"]["rows"].items():
            ours = self.results["sensitivity"][case]["percent"]
            yield (case, "thesis", *(_percent(each) for each in theirs))
            yield ("", "ours", *(_percent(each) for each in ours))

    def _payload_tables(self, payload: Tree) -> Iterator[str]:
        motion = self.facts["payload_motion"]
        counts = self._counts(payload)
        yield f"""### Tables 5.6, 5.10 and 5.11: estimates of three payloads, second run subtracted

Only axes 3 to 6 move, with harmonics {motion["low_harmonic"]} and {motion["high_harmonic"]} of a period of
{motion["period_s"]:g} s, as in the thesis. We measure 5 periods instead of {motion["periods"]}, with {counts}. The
thesis has ten experiments of the medium payload. The table shows our largest error and the mean of the standard deviations
that the program reports. These include an uncertainty of the torque constants of 1 %.
"""
        yield from self._payload_table(payload, "difference")
        yield from self._holds("payloads")
        masses = [
            each["values"][0]
            for each in payload["experiments"]
            if each["procedure"] == "model" and each["payload"] == "medium"
        ]
        theirs = self.facts["payload_by_model"]
        yield f"""### Table 5.8: modelled robot subtracted

The robot was identified from another motion. Ten experiments of the thesis gave masses of the medium payload from
{theirs["least_mass_kg"]} to {theirs["largest_mass_kg"]} kg; ours are from {min(masses):.2f} to {max(masses):.2f} kg. The
true mass is {self.facts["payloads"]["mass_kg"]["medium"]} kg.
"""
        yield from self._payload_table(payload, "model")
        yield from self._holds("model")
        yield """### Table 5.7 and figure 5.9: torque of another motion with payload

RMS errors of the predicted torque of axes 3 to 6, and RMS torque, in N m (the thesis's numbers have not survived):
"""
        yield from table(
            ("payload estimated with", "axis 3", "axis 4", "axis 5", "axis 6"),
            [
                (words, *(f"{a:.3g} of {b:.3g}" for a, b in zip(
                    payload[key]["error_nm"], payload[key]["torque_nm"], strict=True)))
                for words, key in (("a second run", "other_difference"),
                                   ("a modelled robot", "other_model"))
            ],
        )  # fmt: skip

    def _counts(self, payload: Tree) -> str:
        own = [e["payload"] for e in payload["experiments"] if e["procedure"] == "difference"]
        return ", ".join(f"{own.count(name)} of the {name} payload" for name in dict.fromkeys(own))

    def _payload_table(self, payload: Tree, procedure: str) -> Iterator[str]:
        rows = []
        for name in dict.fromkeys(each["payload"] for each in payload["experiments"]):
            own = [
                each
                for each in payload["experiments"]
                if (each["payload"], each["procedure"]) == (name, procedure)
            ]
            scale = np.array([1.0, *(1e3,) * 3, *(1.0,) * 6])
            errors = scale * np.abs([each["errors"] for each in own]).max(axis=0)
            std = scale * np.mean([each["std"] for each in own], axis=0)
            cells = [f"{e:.2g} (σ {s:.2g})" for e, s in zip(errors, std, strict=True)]
            rows.append((name, *cells))
        names = [f"{name} [{unit}]" for name, unit in zip(REPORTED, UNITS, strict=True)]
        yield from table(("payload", *names), rows)

    def _chapter_6(self) -> Iterator[str]:
        path, facts = self.results["path"], self.facts
        circle, loop = facts["circle"], path["loop"]
        yield f"""## Chapter 6: path compensation

### Figure 6.4: velocity loop

Our multisine gives a PI controller with a gain of {loop["gain_nm_s"]:.4g} N m s/rad and an integral time of
{1e3 * loop["integral_time_s"]:.3g} ms for axis 1. The figure shows frequencies up to 5 Hz, as in the thesis.

![Response of the velocity controller of axis 1](pictures/thesis/loop.svg)

### Figure 6.5 and table 6.1: tracking error of the joints

Circle of {100 * circle["diameter_m"]:.0f} cm diameter at {circle["speed_m_s"]} m/s in a horizontal plane,
{circle["periods"]} turns. Largest errors in mrad (those of the thesis are read from the figure):
"""
        theirs = facts["joint_peaks"]
        yield from table(
            ("", "thesis, largest axis", "ours, axes 1 to 3"),
            [
                ("without compensation", f"about {theirs['plain_mrad']:g}",
                 _list(path["circle_plain"]["peaks_mrad"])),
                ("with compensation", f"about {theirs['compensated_mrad']:g}",
                 _list(path["circle_classical"]["peaks_mrad"])),
            ],
        )  # fmt: skip
        yield """![Tracking error of three axes, without and with compensation](pictures/thesis/tracking.svg)

### Figure 6.7 and table 6.2: path error
"""
        theirs = facts["path"]
        yield from table(
            ("path error [mm]", "mean", "largest"),
            [
                ("thesis, without", theirs["plain_mean_mm"], theirs["plain_max_mm"]),
                ("thesis, with", theirs["compensated_mean_mm"], theirs["compensated_max_mm"]),
                *(
                    (words, path[key]["mean_mm"], path[key]["max_mm"])
                    for words, key in (
                        ("ours, without", "circle_plain"),
                        ("ours, with; Coulomb and viscous friction", "circle_classical"),
                        ("ours, with; chosen friction terms", "circle_chosen"),
                        ("ours, vertical circle of 30 cm at 0.5 m/s, without", "other_plain"),
                        ("ours, vertical circle, with", "other_classical"),
                        ("ours, vertical circle, with; chosen friction terms", "other_chosen"),
                    )
                ),
            ],
        )
        yield from self._holds("path")
        yield from self._holds("other_path")
        yield """![Path error in three directions, without and with compensation](pictures/thesis/deviation.svg)

**What differs, and why.** Most of our error without compensation is the delay of half a cycle: 3 ms at 0.6 m/s are
1.8 mm. The thesis reports the same delay and a smaller error, so its controller followed somewhat more closely than ours.
Compensation removes the delay in both. What remains is friction at velocity reversals and noise. The chosen friction
terms model more of this friction than the terms of the thesis. Both are errors at the motors: a real arm bends in
addition, and [following a path](guide/follow-a-path.md) says what this means for the tool.
"""


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{each:.4g}" for each in values)


def _percent(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}" if abs(value) < 100.0 else f"{value:.0f}"  # noqa: PLR2004
