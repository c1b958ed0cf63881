"""`write_pictures`: the figures of the page as SVG, readable on light and dark pages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.thesis.records import Tree

INK: Final = "#7f7f7f"
"""Colour of axes and texts, with sufficient contrast on white and on black."""

COLOURS: Final = ("#0091d5", "#e0701a", "#2ca05a", "#b05cc8")
STYLE: Final[dict[Any, Any]] = {
    "svg.hashsalt": "thesis",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "grid.color": INK,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.1,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
}
WIDTH: Final = 7.2


def write_pictures(results: Tree, folder: Path) -> None:
    """Write all pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    robot, path, friction = results["robot"], results["path"], results["friction"]
    combined = robot["combined"]
    with mpl.rc_context(STYLE):
        pictures = {
            "excitation": _positions(robot["excitation"]),
            "points": _positions(robot["points"]),
            "rotors": _errors(
                (robot["without_rotors"]["excitation"], robot["internal"]["excitation"]),
                ("without rotor inertia", "with rotor inertia"),
            ),
            "friction": _friction(friction),
            "torque": _prediction(combined["excitation"]),
            "wrench": _reaction(combined["excitation_wrench"]),
            "validation": _prediction(combined["points"]),
            "reaction": _reaction(combined["points_wrench"]),
            "assumptions": _prediction(results["wrong_prediction"], first_axis=3),
            "payload": _prediction(results["payload"]["other_curves"], first_axis=3),
            "warming": _warming(results["warming"]),
            "loop": _loop(path["loop"]),
            "tracking": _tracking(path["curves"]),
            "reversal": _reversal(results["reversal"]),
            "deviation": _deviation(path["curves"]),
        }
        for name, figure in pictures.items():
            figure.savefig(
                folder / f"{name}.svg", transparent=True, metadata={"Date": None, "Creator": None}
            )


def _figure(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _positions(found: Tree) -> Figure:
    figure, ((axes,),) = _figure(1, 1, 2.4)
    for j, values in enumerate(found["position_rad"]):
        axes.plot(found["time_s"], values, color=COLOURS[j], label=f"axis {j + 1}")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("position [rad]")
    axes.legend(ncols=3)
    return figure


def _errors(models: Sequence[Tree], titles: Sequence[str]) -> Figure:
    """Return measured torque and error of the prediction, one column for each model."""
    figure, grid = _figure(3, len(models), 5.0, sharex=True, sharey="row")
    for column, (curves, title) in enumerate(zip(models, titles, strict=True)):
        for j in range(3):
            axes = grid[j][column]
            measured, predicted = (np.array(curves[key][j]) for key in ("measured", "predicted"))
            axes.plot(curves["time_s"], measured, color=COLOURS[0], label="measured")
            axes.plot(curves["time_s"], measured - predicted, color=COLOURS[1], label="error")
            grid[j][0].set_ylabel(f"axis {j + 1} [N m]")
        grid[0][column].set_title(title)
        grid[2][column].set_xlabel("time [s]")
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _prediction(curves: Tree, first_axis: int = 1) -> Figure:
    """Return measured and predicted torque on the left, and the error on the right."""
    count = len(curves["measured"])
    figure, grid = _figure(count, 2, 1.4 * count + 0.6, sharex=True)
    for j, (left, right) in enumerate(grid):
        measured, predicted = (np.array(curves[key][j]) for key in ("measured", "predicted"))
        left.plot(curves["time_s"], measured, color=COLOURS[0], label="measured")
        left.plot(curves["time_s"], predicted, color=COLOURS[1], linestyle="--", label="predicted")
        right.plot(curves["time_s"], measured - predicted, color=COLOURS[2])
        left.set_ylabel(f"axis {j + first_axis} [N m]")
    grid[0][0].set_title("measured and predicted torque")
    grid[0][1].set_title("error of the prediction")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _friction(found: Tree) -> Figure:
    figure, (row,) = _figure(1, 3, 2.6)
    for axes, joint, runs in zip(
        row,
        ("axis1", "axis4", "axis6"),
        (("cold",), ("cold", "warm"), ("warm", "loaded")),
        strict=True,
    ):
        words = {"cold": "cold", "warm": "warm", "loaded": "warm, with payload"}
        for colour, run in zip(COLOURS, runs, strict=False):
            one = found[run][joint]
            axes.plot(
                one["speed_rad_s"], one["friction_nm"], marker="o", markersize=3.0, color=colour,
                label=words[run],
            )  # fmt: skip
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("speed [rad/s]")
        axes.set_ylabel(f"friction of {joint.replace('axis', 'axis ')} [N m]")
        axes.legend()
    return figure


def _reaction(curves: Tree) -> Figure:
    figure, grid = _figure(3, 2, 5.0, sharex=True)
    for i, name in enumerate(("Fx", "Fy", "Fz", "Mx", "My", "Mz")):
        axes = grid[i % 3][i // 3]
        measured, predicted = (np.array(curves[key][i]) for key in ("measured", "predicted"))
        axes.plot(curves["time_s"], measured, color=COLOURS[0], label="measured")
        axes.plot(curves["time_s"], predicted, color=COLOURS[1], linestyle="--", label="predicted")
        axes.plot(curves["time_s"], measured - predicted, color=COLOURS[2], label="error")
        axes.set_ylabel(f"{name} [{'N' if name[0] == 'F' else 'N m'}]")
    for axes in grid[2]:
        axes.set_xlabel("time [s]")
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _warming(found: Tree) -> Figure:
    figure, grid = _figure(2, 3, 4.4, sharex=True)
    cold, corrected, true = found["cold"], found["corrected"], found["true"]
    number = np.arange(1, len(cold["values"][0]) + 1)
    for axes, key, label in zip(
        grid[0],
        ("coulomb_nm", "viscous_nm_s"),
        ("Coulomb friction [% of first value]", "viscous friction [% of first value]"),
        strict=False,
    ):
        for j, values in enumerate(cold[key]):
            relative = 100.0 * np.array(values) / values[0]
            axes.plot(number, relative, color=COLOURS[j], label=f"axis {j + 3}")
        axes.set_ylabel(label)
    grid[0][0].legend()
    mass = grid[0][2]
    mass.plot(number, cold["values"][0], color=COLOURS[0], label="constants of cold motors")
    mass.plot(number, corrected["values"][0], color=COLOURS[1], label="corrected")
    mass.axhline(true[0], color=INK, linestyle="--", label="true")
    mass.set_ylabel("mass [kg]")
    mass.legend()
    for axes, first, scale, names, unit in (
        (grid[1][0], 1, 1e3, ("cx", "cy", "cz"), "centre of gravity [mm]"),
        (grid[1][1], 4, 1.0, ("Ixx", "Iyy", "Izz"), "moments of inertia [kg m²]"),
        (grid[1][2], 7, 1.0, ("Ixy", "Ixz", "Iyz"), "products of inertia [kg m²]"),
    ):
        for i, name in enumerate(names):
            off = scale * (np.array(cold["values"][first + i]) - true[first + i])
            axes.plot(number, off, color=COLOURS[i], label=name)
        axes.set_ylabel(f"error, {unit}")
        axes.set_xlabel("measurement")
        axes.legend()
    return figure


def _loop(found: Tree) -> Figure:
    figure, (row,) = _figure(1, 2, 2.4)
    for axes, key, label in zip(
        row, ("magnitude_db", "phase_deg"), ("gain [dB of N m s/rad]", "phase [°]"), strict=True
    ):
        measured, model = found["measured"], found["model"]
        axes.plot(
            measured["frequency_hz"], measured[key], "o", markersize=3.0, color=COLOURS[0],
            label="measured",
        )  # fmt: skip
        axes.plot(model["frequency_hz"], model[key], color=COLOURS[1], label="PI model")
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(label)
    row[0].legend()
    return figure


def _tracking(curves: Tree) -> Figure:
    figure, (row,) = _figure(1, 2, 2.6, sharey=True)
    for axes, name, title in zip(
        row, ("plain", "compensated"), ("without compensation", "with compensation"), strict=True
    ):
        one = curves[name]
        for j, values in enumerate(one["joint_mrad"]):
            axes.plot(one["time_s"], values, color=COLOURS[j], label=f"axis {j + 1}")
        axes.set_title(title)
        axes.set_xlabel("time [s]")
    row[0].set_ylabel("tracking error [mrad]")
    row[1].legend()
    return figure


def _reversal(found: Tree) -> Figure:
    figure, ((upper,), (lower,)) = _figure(2, 1, 3.4, sharex=True)
    upper.plot(found["time_s"], found["error_mrad"], color=COLOURS[1])
    upper.set_ylabel("tracking error [mrad]")
    lower.plot(found["time_s"], found["velocity_rad_s"], color=COLOURS[0])
    lower.set_ylabel("velocity [rad/s]")
    lower.set_xlabel("time [s]")
    return figure


def _deviation(curves: Tree) -> Figure:
    figure, (row,) = _figure(1, 3, 2.4, sharey=True)
    for i, (axes, name) in enumerate(zip(row, "xyz", strict=True)):
        for colour, key, label in (
            (COLOURS[1], "plain", "without"),
            (COLOURS[0], "compensated", "with compensation"),
        ):
            one = curves[key]
            axes.plot(one["time_s"], one["deviation_mm"][i], color=colour, label=label)
        axes.set_title(f"{name} direction")
        axes.set_xlabel("time [s]")
    row[0].set_ylabel("path error [mm]")
    row[2].legend()
    return figure
