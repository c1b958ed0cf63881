"""What `rid-daq loop` found, as a section of the result and as sentences."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from compensation.loops.cascade import Cascade, GainAdvice, Margins
from compensation.loops.frequency_response import Distortion, FrequencyResponse
from compensation.loops.loop_measurement import LoopMeasurement
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from rid_daq.report.sections import rounded, units

SMALLEST_P = 0.001
LARGEST_MISFIT = 0.3
FIT_POINTS = 200
CASCADE_POINTS = 300
LOWEST_HZ = 0.2
HIGHEST_HZ = 50.0


def velocity_loop_section(
    robot: RobotDescription, measured: LoopMeasurement, advice: GainAdvice
) -> dict[str, Any]:
    """Return responses, fitted controllers, margins and advice, axis by axis.

    Parameters
    ----------
    robot
        The robot, for units.
    measured
        Responses and fits.
    advice
        About the position gain.
    """
    first, left_out = measured.controllers[0], measured.left_out
    sentence = (
        f"{first.realisations} realisations of {first.periods} periods. Intervals are two standard"
        " deviations, from what differs between periods and between realisations. Gain and integral"
        " time are fitted to the complex response by maximum likelihood; delay and lag are taken"
        " into the fit where the description length gets shorter by them."
    )
    if left_out:
        numbers = ", ".join(str(k) for k in left_out)
        sentence += f" Left out, because rows are missing: realisation {numbers}."
    if first.realisations == 1:
        sentence += " One realisation cannot tell nonlinear distortion from the response."
    return {
        "sentence": sentence,
        "position_gain_per_s": advice.present_per_s,
        "largest_position_gain_per_s": _finite(advice.largest_per_s),
        "advice": advice.sentence,
        "axes": [
            _axis(robot, controller, axis, cascade)
            for controller, axis, cascade in zip(
                measured.controllers, measured.mechanics, measured.cascades, strict=True
            )
        ],
    }


def _axis(
    robot: RobotDescription,
    controller: FrequencyResponse,
    mechanics: FrequencyResponse,
    cascade: Cascade,
) -> dict[str, Any]:
    loop, axis = cascade.loop, cascade.mechanics
    joint = robot.joints[robot.joint_names.index(loop.joint_name)]
    position_unit, torque_unit = units(joint)
    sigma = np.sqrt(np.diagonal(axis.covariance))
    return {
        "joint": loop.joint_name,
        "unit": f"{torque_unit} s/{position_unit}",
        "gain": loop.gain,
        "integral_time_s": loop.integral_time_s,
        "delay_s": loop.delay_s,
        "lag_s": loop.lag_s,
        "std": loop.sigma,
        "covariance": loop.covariance.tolist(),
        "p_value": loop.p_value,
        "whiteness": loop.whiteness,
        "trials": [
            {"extras": list(t.extras), "cost": t.cost, "aic": t.aic, "mdl": t.mdl}
            for t in loop.trials
        ],
        "inertia": axis.inertia,
        "inertia_unit": "kg m^2" if position_unit == "rad" else "kg",
        "damping": axis.damping,
        "mechanics_std": {"inertia": float(sigma[0]), "damping": float(sigma[1])},
        "mechanics_misfit": axis.misfit,
        "velocity_margins": _margins(cascade.velocity_margins),
        "position_margins": _margins(cascade.position_margins),
        "position_peak": cascade.peak,
        "largest_position_gain_per_s": _finite(cascade.largest_position_gain_per_s),
        "response": _response(controller, loop),
        "mechanics_response": {
            "frequency_hz": mechanics.frequency_hz.tolist(),
            **_polar(mechanics.response),
            "std_total": rounded(np.sqrt(mechanics.variance)),
            "coherence": rounded(mechanics.coherence),
        },
        "cascade": _cascade(controller, mechanics, cascade),
        "findings": _findings(controller, cascade),
    }


def _response(measured: FrequencyResponse, loop: VelocityLoop) -> dict[str, Any]:
    f = measured.frequency_hz
    grid = np.geomspace(f[0], f[-1], FIT_POINTS)
    return {
        "frequency_hz": f.tolist(),
        **_polar(measured.response),
        "std_noise": rounded(np.sqrt(measured.variance_noise)),
        "std_total": rounded(np.sqrt(measured.variance)),
        "coherence": rounded(measured.coherence),
        "even": _distortion(measured.even),
        "odd": _distortion(measured.odd),
        "fit": {"frequency_hz": rounded(grid), **_polar(loop.response(grid))},
    }


def _cascade(
    controller: FrequencyResponse, mechanics: FrequencyResponse, cascade: Cascade
) -> dict[str, Any]:
    highest = min(HIGHEST_HZ, 0.45 / cascade.cycle_time_s)
    grid = np.geomspace(LOWEST_HZ, highest, CASCADE_POINTS)
    f = controller.frequency_hz
    opened = controller.response * mechanics.response
    modelled = cascade.position_loop(f) / cascade.closed_velocity_loop(f)
    measured = modelled * opened / (1.0 + opened)
    shown = f <= highest
    return {
        "frequency_hz": rounded(grid),
        "velocity": {
            **_polar(cascade.velocity_loop(grid)),
            "margins": _margins(cascade.velocity_margins),
        },
        "position": {
            **_polar(cascade.position_loop(grid)),
            "margins": _margins(cascade.position_margins),
        },
        "measured": {"frequency_hz": rounded(f[shown]), **_polar(measured[shown])},
    }


def _findings(measured: FrequencyResponse, cascade: Cascade) -> list[str]:
    """Say what is wrong, if anything."""
    loop, found = cascade.loop, []
    if loop.p_value < SMALLEST_P:
        found.append(
            "a proportional-integral controller does not explain what was measured: look for"
            " filters in the drive, or excite less"
        )
    if loop.whiteness < SMALLEST_P:
        found.append(
            "what the fit leaves is alike on neighbouring lines: a term is missing, such as a"
            " filter or a second delay"
        )
    weak = measured.frequency_hz[measured.coherence < 0.5]
    if len(weak):
        where = ", ".join(f"{f:.3g}" for f in weak)
        found.append(
            f"torque follows the multisine badly (coherence below 0.5) at {where} Hz: these lines"
            " hardly count; excite more, or start the band higher"
        )
    if cascade.mechanics.misfit > LARGEST_MISFIT:
        found.append(
            f"the axis is not one inertia (misfit {100.0 * cascade.mechanics.misfit:.0f} %):"
            " elastic, or stuck; its margins do not hold"
        )
    return found


def _distortion(found: Distortion) -> dict[str, list[float]]:
    return {
        "frequency_hz": rounded(found.frequency_hz),
        "output": rounded(found.output),
        "level": rounded(found.level),
        "noise": rounded(found.noise),
    }


def _polar(response: np.ndarray[Any, Any]) -> dict[str, list[float]]:
    """Return magnitude and phase, the phase between -360 and 0 degrees at its start."""
    phase: FloatArray = np.degrees(np.unwrap(np.angle(response)))
    phase = phase - 360.0 * np.ceil(phase[0] / 360.0 - 1e-9) if len(phase) else phase
    return {"magnitude": rounded(np.abs(response), 6), "phase_deg": rounded(phase)}


def _margins(found: Margins) -> dict[str, float | None]:
    return {**asdict(found), "gain_db": found.gain_db}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
