"""What a force plate adds to results and reports: reaction, improvement, consistency, limits."""

from __future__ import annotations

from typing import Any

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from identification.accuracy.plate_benefit import Improvement
from identification.calibration.base_reaction import BaseLoad, weight_parameters
from identification.calibration.torque_scale import TorqueConsistency
from identification.estimation.estimate import Estimate
from identification.validation.reaction_prediction import ReactionValidation
from rid_daq.report.render import number
from rid_daq.report.result import check
from rid_daq.report.sections import rounded, thinned
from rid_daq.terminal.console import Console


def plate_section(
    estimate: Estimate, improved: Improvement | None, torques: TorqueConsistency | None
) -> dict[str, Any]:
    """Return how a force plate fits an estimate, and what it improved.

    Parameters
    ----------
    estimate
        Of the external or the combined model.
    improved, torques
        What the combined model says of the plate's gain and of the torque constants.
    """
    plate = estimate.plate
    if plate is None:
        return {}
    sentences = [_fit_sentence(estimate)]
    sentences += [] if improved is None else [improved.sentence]
    sentences += [] if torques is None else [torques.sentence]
    return {
        "sentences": sentences,
        "components": [
            {
                "name": name,
                "unit": unit,
                "residual": float(plate.residual[k]),
                "noise": float(plate.noise[k]),
            }
            for k, (name, unit) in enumerate(zip(WRENCH_NAMES, WRENCH_UNITS, strict=True))
        ],
        "delay_s": plate.delay_s.tolist(),
        "delay_std_s": plate.delay_sigma_s.tolist(),
        "left_out": [list(names) for names in plate.left_out],
        "drift_n_s": plate.drift_n_s.tolist(),
        "improvement": None if improved is None else _improvement(improved),
        "torque_constants": None if torques is None else _torque_constants(torques),
    }


def weight_words(estimate: Estimate) -> tuple[str, ...]:
    """Return the parameters that only the standing weight shows, in words."""
    if estimate.options.kind == "internal":
        return ()
    return tuple(estimate.base.expressions[i] for i in weight_parameters(estimate))


def reaction_section(validation: ReactionValidation) -> dict[str, Any]:
    """Return the errors of a predicted base wrench, with its curves thinned for drawing."""
    rows = thinned(len(validation.time_s))
    return {
        "sentence": validation.sentence,
        "delay_s": validation.delay_s,
        "components": [
            {
                "name": name,
                "unit": unit,
                "rms_error": float(validation.rms[k]),
                "relative_error_percent": float(validation.relative_percent[k]),
                "noise": None if validation.noise is None else float(validation.noise[k]),
                "measured": rounded(validation.measured[rows, k]),
                "predicted": rounded(validation.predicted[rows, k]),
            }
            for k, (name, unit) in enumerate(zip(WRENCH_NAMES, WRENCH_UNITS, strict=True))
        ],
        "time_s": rounded(validation.time_s[rows] - validation.time_s[0], 7),
    }


def load_section(load: BaseLoad) -> dict[str, Any]:
    """Return the largest reaction of a motion against its limits."""
    return {
        "sentence": load.sentence,
        "weight_known": load.weight_known,
        "components": [
            {
                "name": name,
                "unit": unit,
                "peak": float(load.peak[k]),
                "std": float(load.sigma[k]),
                "at_s": float(load.at_s[k]),
                "limit": float(load.limit[k]),
                "held": load.held[k],
            }
            for k, (name, unit) in enumerate(zip(WRENCH_NAMES, WRENCH_UNITS, strict=True))
        ],
    }


def load_checks(section: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the lines of a verdict on limits of the base."""
    return [
        check(
            f"reaction on the base with 2σ, {each['name']}",
            each["peak"] + 2.0 * each["std"],
            "≤",
            each["limit"],
            each["unit"],
        )
        for each in section["components"]
    ]


def tell_plate(console: Console, section: dict[str, Any]) -> None:
    """Say what a force plate improved."""
    improved = section["improvement"]
    if improved is not None:
        console.say("Standard deviations by the measured noise, with torques, plate, and both:")
        console.table(
            ("parameter", "torques", "plate", "both", "unit"),
            [
                (
                    each["words"],
                    number(each["std_internal"], 2),
                    number(each["std_external"], 2),
                    number(each["std_combined"], 2),
                    each["unit"],
                )
                for each in improved["parameters"]
            ],
        )
    for sentence in section["sentences"]:
        console.say(sentence)


def tell_reaction(console: Console, section: dict[str, Any]) -> None:
    """Say how well the base wrench was predicted."""
    console.table(
        ("reaction", "rms error", "relative", "noise"),
        [
            (
                each["name"],
                f"{number(each['rms_error'])} {each['unit']}",
                f"{number(each['relative_error_percent'], 3)} %",
                "–" if each["noise"] is None else f"{number(each['noise'], 3)} {each['unit']}",
            )
            for each in section["components"]
        ],
    )


def tell_load(console: Console, section: dict[str, Any]) -> None:
    """Say what a motion does to the floor."""
    console.table(
        ("reaction", "largest", "± 2σ", "limit", "holds"),
        [
            (
                each["name"],
                f"{number(each['peak'])} {each['unit']}",
                number(2.0 * each["std"], 2),
                f"{each['limit']:g} {each['unit']}",
                "yes" if each["held"] else "NO",
            )
            for each in section["components"]
        ],
        red=[not each["held"] for each in section["components"]],
    )


def _fit_sentence(estimate: Estimate) -> str:
    plate = estimate.plate
    assert plate is not None
    delays = ", ".join(
        f"{1e3 * delay:.3f} ± {2e3 * sigma:.3f}"
        for delay, sigma in zip(plate.delay_s, plate.delay_sigma_s, strict=True)
    )
    words = f"The force plate's signals were {delays} ms late, which is made up for"
    words += f"; drift of up to {1e3 * abs(plate.drift_n_s).max():.3g} mN/s a channel is removed"
    left_out = sorted({name for names in plate.left_out for name in names})
    if left_out:
        words += f"; {', '.join(left_out)} not used, for overload, loss or drift"
    weight = ", ".join(weight_words(estimate))
    if weight:
        words += f". {weight} is the standing weight, which a plate cannot tell from its offset"
    return words + "."


def _improvement(improved: Improvement) -> dict[str, Any]:
    return {
        "determinant_ratio": improved.determinant_ratio,
        "shared": list(improved.shared),
        "parameters": [
            {
                "words": each.expression,
                "unit": each.unit,
                "value": each.value,
                "std_internal": each.sigma_internal,
                "std_external": each.sigma_external,
                "std_combined": each.sigma_combined,
            }
            for each in improved.parameters
        ],
    }


def _torque_constants(torques: TorqueConsistency) -> dict[str, Any]:
    return {
        "p_value": torques.p_value,
        "axes": [
            {
                "joint": axis.joint,
                "ratio": axis.ratio,
                "std": axis.sigma,
                "p_value": axis.p_value,
                "wrong": axis.wrong,
            }
            for axis in torques.axes
        ],
    }
