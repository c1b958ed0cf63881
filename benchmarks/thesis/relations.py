"""`relations`: statements of the thesis, checked on our results."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.thesis.records import Tree
from config.arrays import FloatArray

SMALL: Final = 0.05
"""Largest relative change that counts as no change."""

SIGMAS: Final = 2.0
"""Number of standard deviations from which a difference counts as significant."""

SLIGHT: Final = (
    "wrist coupling neglected",
    "efficiency 90 %",
    "efficiency 95 %",
    "25 % of friction acts in the joints",
)
"""Wrong assumptions that hardly change the mass in the thesis."""

SLIGHT_PERCENT: Final = 1.0
"""Change of the mass [%] that no assumption of `SLIGHT` exceeds in the thesis."""

LONGEST_AFTER_S: Final = 0.1
"""Largest time after a velocity reversal that counts as near it [s]."""

LOW_SPEED: Final = 0.2
"""Fraction of an axis's largest speed up to which its speed counts as low."""

PLATE_MODELS: Final = ("external", "combined")

ILL: Final = 10.0
"""Ratio of condition numbers from which the larger one counts as bad."""


@dataclass(frozen=True)
class Relation:
    """A statement of the thesis.

    Attributes:
        section: Section of the page in which the statement is.
        text: The statement with our numbers.
        holds: True if our results agree.
        reason: Known cause why our results need not agree; empty if they should.
    """

    section: str
    text: str
    holds: bool
    reason: str = ""

    @property
    def is_unexplained(self) -> bool:
        """True if our results differ and no cause is known."""
        return not self.holds and not self.reason


def relations(facts: Tree, results: Tree) -> list[Relation]:
    """Return all relations.

    Short payload experiments are too few and too noisy for relations about their errors.
    """
    return [
        *_robot(facts, results["robot"]),
        *_plate(results["robot"]),
        *_friction(results["friction"]),
        *_sensitivity(results["sensitivity"]),
        *_wrong_prediction(results["wrong_prediction"]),
        *_payload(facts, results["payload"], is_short="payload" in results["short"]),
        *_warming(results["warming"]),
        *_path(facts, results["path"]),
        *_reversal(results["reversal"]),
    ]


def _robot(facts: Tree, robot: Tree) -> Iterator[Relation]:
    count, wanted = robot["internal"]["links"], facts["base_parameters"]["internal_links"]
    yield Relation(
        "base",
        f"The internal model has {wanted} independent parameters of the links; ours has {count}.",
        count == wanted,
    )
    ours, without = robot["internal"]["points_nm"][2], robot["without_rotors"]["points_nm"][2]
    yield Relation(
        "rotors",
        "A model without rotor inertia predicts the torque of axis 3 less accurately: the error"
        f" is {without / ours:.2f} times as large.",
        without > (1.0 + SMALL) * ours,
    )
    change = _largest(_changes(robot["calibrated"]["points_nm"], robot["internal"]["points_nm"]))
    yield Relation(
        "kinematics",
        "Calibrated kinematics do not improve the torque prediction: on the random points, no error"
        f" changes by more than {100.0 * SMALL:g} % (largest change {100.0 * change:.1f} %).",
        change <= SMALL,
    )
    worse = robot["calibrated"]["condition"] / robot["internal"]["condition"]
    yield Relation(
        "kinematics",
        "With calibrated kinematics, the equations are badly conditioned, because further"
        f" parameters are hardly excited: the condition number is {worse:.0f} times as large.",
        worse > ILL,
    )


def _plate(robot: Tree) -> Iterator[Relation]:
    std = np.array([each["std"] for each in robot["deviations"]])
    gain = float(np.min(np.minimum(std[:, 0], std[:, 1]) / std[:, 2]))
    yield Relation(
        "deviations",
        "The combined model has the smallest standard deviation for every parameter: the smaller"
        f" one of internal and external model is at least {gain:.2f} times as large.",
        gain >= 1.0,
    )
    points, excited = (
        _changes(robot["combined"][key], robot["internal"][key])
        for key in ("points_nm", "excitation_nm")
    )
    yield Relation(
        "plate_torque",
        "The plate hardly changes the torque prediction: on the random points, no error changes by"
        f" more than {100.0 * SMALL:g} % (axes 1 to 3: {_percent_list(points)}; on the excitation"
        f" run: {_percent_list(excited)}).",
        _largest(points) <= SMALL,
        reason="A positive change means that the combined model has the larger error. The internal"
        " model is fitted to the torques alone, and the combined model also to the reaction. The"
        " simulated robot has effects that neither model contains, so both fits differ.",
    )
    torque, slow, fast = _errors_by_speed(robot)
    yield Relation(
        "reversals",
        "The error of the predicted torque is small, except at velocity reversals, because friction"
        f" at low velocity is not modelled accurately. At speeds above {100.0 * LOW_SPEED:g} % of"
        f" the largest, it is {_values(fast)} N m for axes 1 to 3"
        f" ({_values(100.0 * fast / torque)} % of the torque), and below {_values(slow)} N m.",
        bool(np.all(fast < SMALL * torque) and np.all(slow > fast)),
    )
    external, combined = (
        np.array(robot[name]["excitation_wrench"]["rms"]) for name in PLATE_MODELS
    )
    gain = float(np.max(1.0 - combined / external))
    yield Relation(
        "excitation_wrench",
        "The combined model does not improve the prediction of the reaction significantly: no error"
        f" decreases by more than {100.0 * SMALL:g} % (changes"
        f" {_percent_list(combined / external - 1.0)}).",
        gain <= SMALL,
    )
    change = _largest(_changes(robot["combined"]["wrench"], robot["external"]["wrench"]))
    yield Relation(
        "wrench",
        "External and combined model predict the reaction equally well: no error differs by more"
        f" than {100.0 * SMALL:g} % (largest difference {100.0 * change:.1f} %).",
        change <= SMALL,
    )
    noise = robot["combined"]["excitation_wrench"]["noise_percent"]
    yield Relation(
        "wrench_noise",
        "The noise of the reaction forces is high in proportion to the forces, compared with the"
        f" moments: in one period up to {max(noise[:3]):.2g} % of a force, and up to"
        f" {max(noise[3:]):.2g} % of a moment.",
        max(noise[:3]) > max(noise[3:]),
    )


def _errors_by_speed(robot: Tree) -> FloatArray:
    """Return RMS torque, and RMS errors of the combined model at low and other speeds, (3, n)."""
    curves, motion = robot["combined"]["excitation"], robot["excitation"]
    time_s = np.array(curves["time_s"])
    found = []
    for measured, predicted, position in zip(
        curves["measured"], curves["predicted"], motion["position_rad"], strict=True
    ):
        speed = np.abs(np.gradient(np.interp(time_s, motion["time_s"], position), time_s))
        is_slow = speed <= LOW_SPEED * speed.max()
        error = np.subtract(measured, predicted)
        found.append([_rms(measured), _rms(error[is_slow]), _rms(error[~is_slow])])
    return np.array(found).T


def _friction(friction: Tree) -> Iterator[Relation]:
    cold, warm = (_mean_friction(friction[name]["axis4"]) for name in ("cold", "warm"))
    yield Relation(
        "warm",
        "A warm robot has less friction than a cold one: axis 4 has"
        f" {100.0 * (1.0 - warm / cold):.0f} % less.",
        warm < cold,
    )
    empty, loaded = (_mean_friction(friction[name]["axis6"]) for name in ("warm", "loaded"))
    std = math.hypot(*(_mean_friction_std(friction[name]["axis6"]) for name in ("warm", "loaded")))
    yield Relation(
        "loaded",
        "A payload increases friction by more than two standard deviations: with the medium"
        f" payload, the friction of axis 6 changes by {100.0 * (loaded / empty - 1.0):+.1f} %, with"
        f" a standard deviation of {100.0 * std / empty:.1f} %.",
        loaded - empty > SIGMAS * std,
        reason="The friction of `kr15` grows by 0.4 % of the transmitted torque only. This"
        " experiment does not resolve such a small increase.",
    )
    errors = friction["warm"]["axis6"]["rms_nm"]
    ratio = errors["cube root"] / errors["classical"]
    yield Relation(
        "cube_root",
        "On axis 6, viscous friction with the cube root of the speed fits better than Coulomb with"
        f" viscous friction: its error is {ratio:.1f} times as large.",
        ratio < 1.0,
        reason="The friction of `kr15` is simulated as Coulomb, viscous and Stribeck friction."
        " Nothing in it grows with the cube root of the speed.",
    )


def _sensitivity(table: Tree) -> Iterator[Relation]:
    worst = max(max(row["torque_percent"]) for row in table.values())
    largest = max(max(abs(each) for each in row["percent"]) for row in table.values())
    yield Relation(
        "prediction",
        "Wrong assumptions about the robot change the parameters much more than the predicted"
        f" torque: parameters by up to {largest:.0f} %, torques by up to {worst:.1f} %.",
        worst < 0.1 * largest,
    )
    mass = {case: abs(row["percent"][0]) for case, row in table.items()}
    yield Relation(
        "mass",
        f"Wrong link parameters cause the largest error of the mass: {mass['robot links']:.1f} %.",
        mass["robot links"] == max(mass.values()),
    )
    slight = {case: mass[case] for case in SLIGHT}
    most = max(slight, key=slight.__getitem__)
    yield Relation(
        "mass",
        "Coupling, gear losses and friction in the joints change the mass by less than"
        f" {SLIGHT_PERCENT:g} %: ours by at most {slight[most]:.1f} % ({most}).",
        slight[most] < SLIGHT_PERCENT,
        reason="Gear losses grow with the transmitted torque, which depends on links, poses and"
        " motion. Those of the thesis are unknown. With an efficiency of 95 %, our mass changes by"
        f" {slight['efficiency 95 %']:.1f} %.",
    )


def _wrong_prediction(found: Tree) -> Iterator[Relation]:
    error, noise = np.array(found["error_nm"]), np.array(found["noise_nm"])
    yield Relation(
        "wrong_prediction",
        "The error of the predicted torque is small compared with the noise and with the torque:"
        f" at most {np.max(error / noise):.2g} times the noise and {max(found['percent']):.1f} % of"
        " the torque.",
        bool(np.all(error < noise)) and max(found["percent"]) < 100.0 * SMALL,
    )


def _payload(facts: Tree, payload: Tree, is_short: bool) -> Iterator[Relation]:
    limits = facts["payload_errors"]
    own = [each for each in payload["experiments"] if each["procedure"] == "difference"]
    errors = np.abs([each["errors"] for each in own])
    std = np.array([each["std"] for each in own])
    of_table = errors[[each["payload"] == limits["payload"] for each in own]]
    mass, centre = of_table[:, 0].max(), 1e3 * of_table[:, 1:4].max()
    inside = float(np.mean(errors <= limits["sigmas"] * std))
    close = float(np.mean((errors <= std)[[each["payload"] == "small" for each in own]]))
    if not is_short:
        yield Relation(
            "payloads",
            f"The mass of the {limits['payload']} payload is within {1e3 * limits['mass_kg']:.0f} g"
            f" and its centre of gravity within a few millimetres: worst {1e3 * mass:.0f} g and"
            f" {centre:.1f} mm (of all payloads: {1e3 * errors[:, 0].max():.0f} g and"
            f" {1e3 * errors[:, 1:4].max():.1f} mm).",
            mass <= limits["mass_kg"] and centre <= limits["centre_mm"],
        )
        one, two = (
            "of the small payload are within one standard deviation",
            "are within two standard deviations",
        )
        for words, fraction in ((two, inside), (one, close)):
            text = f"The true values {words}: this holds for {100.0 * fraction:.0f} % of ours"
            yield Relation("payloads", f"{text} (at least 90 %).", fraction >= 0.9)
    model = [each["std"][0] for each in payload["experiments"] if each["procedure"] == "model"]
    ratio = float(np.mean(model) / np.mean(std[:, 0]))
    yield Relation(
        "model",
        "A modelled robot gives a less certain mass than a second run: its standard deviation is"
        f" {ratio:.1f} times as large.",
        ratio > 1.0,
    )


def _warming(series: Tree) -> Iterator[Relation]:
    (first, last), (corrected_first, corrected_last) = (
        _first_and_last(series[name]["values"])[:, 0] for name in ("cold", "corrected")
    )
    yield Relation(
        "warming",
        f"The estimated mass increases as the robot warms up: from {first:.2f} to {last:.2f} kg"
        f" (true value {series['true'][0]:.2f} kg). Torque constants that are corrected by the"
        f" measured temperatures give {corrected_first:.2f} and {corrected_last:.2f} kg.",
        last > first,
    )
    parts = {}
    for words, key in (("Coulomb", "coulomb_nm"), ("viscous", "viscous_nm_s")):
        cold, warm = _first_and_last(series["cold"][key])
        parts[words] = _changes(warm, cold)
    yield Relation(
        "warming",
        "Friction decreases as the robot warms up (axes 3 to 6): "
        + ", ".join(f"{words} friction {_percent_list(each)}" for words, each in parts.items())
        + ".",
        all(np.all(each < 0.0) for each in parts.values()),
    )


def _first_and_last(rows: list[list[float]]) -> FloatArray:
    """Return the means of the first and of the last quarter of a series, (2, rows)."""
    values = np.array(rows)
    count = max(1, values.shape[1] // 4)
    return np.array([values[:, :count].mean(axis=1), values[:, -count:].mean(axis=1)])


def _path(facts: Tree, path: Tree) -> Iterator[Relation]:
    theirs = facts["path"]
    plain, ours = path["circle_plain"], path["circle_classical"]
    for key, wanted in (
        ("mean_mm", theirs["plain_mean_mm"] / theirs["compensated_mean_mm"]),
        ("max_mm", theirs["plain_max_mm"] / theirs["compensated_max_mm"]),
    ):
        ratio = plain[key] / ours[key]
        yield Relation(
            "path",
            f"Compensation reduces the {'mean' if key == 'mean_mm' else 'largest'} path error"
            f" {wanted:.1f} times; ours {ratio:.1f} times.",
            ratio >= wanted,
        )
    peak = max(ours["peaks_mrad"])
    wanted = facts["joint_peaks"]["compensated_mrad"]
    yield Relation(
        "path",
        f"With compensation the joint errors are at most about {wanted:g} mrad; ours {peak:.2f}.",
        peak <= wanted,
    )
    better = min(
        path["other_plain"][key] / path["other_classical"][key] for key in ("mean_mm", "max_mm")
    )
    yield Relation(
        "other_path",
        "Compensation also improves a circle that was not used for tuning: at least"
        f" {better:.1f} times.",
        better > 1.0,
    )


def _reversal(found: Tree) -> Iterator[Relation]:
    time_s, error, velocity = (
        np.array(found[key]) for key in ("time_s", "error_mrad", "velocity_rad_s")
    )
    reversals_s = time_s[1:][np.diff(np.sign(velocity)) != 0.0]
    fastest_s = float(time_s[np.argmax(np.abs(np.gradient(error, time_s)))])
    turn_s = float(time_s[-1] + time_s[1])
    after_s = min((fastest_s - each) % turn_s for each in reversals_s.tolist())
    yield Relation(
        "reversal",
        "Without compensation, the tracking error of axis 3 has a bend near velocity reversals,"
        f" which Coulomb friction explains: the error changes fastest {1e3 * after_s:.0f} ms after"
        " a reversal.",
        after_s <= LONGEST_AFTER_S,
    )


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _changes(new: ArrayLike, old: ArrayLike) -> FloatArray:
    return np.asarray(np.array(new) / np.array(old) - 1.0)


def _largest(changes: FloatArray) -> float:
    return float(np.max(np.abs(changes)))


def _values(values: FloatArray) -> str:
    return ", ".join(f"{each:.2g}" for each in values)


def _percent_list(changes: FloatArray) -> str:
    return ", ".join(f"{100.0 * each:+.1f} %" for each in changes)


def _mean_friction(curve: Tree) -> float:
    return float(np.mean(curve["friction_nm"]))


def _mean_friction_std(curve: Tree) -> float:
    return float(np.linalg.norm(curve["std_nm"]) / len(curve["std_nm"]))
