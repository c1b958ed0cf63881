"""Diagnosis of prediction errors: one sentence for each joint, and its numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtrc

from config.arrays import BoolArray, FloatArray
from identification.estimation.estimate import Estimate
from identification.validation.torque_prediction import Validation

LAGS: Final = 20
FEWEST_VALUES: Final = 40
WHITE_P: Final = 0.01
WORTH_TELLING: Final = 0.1
NEAR_FLOOR: Final = 1.5
STRIBECK_RAD_S: Final = 0.05

# For each quantity: the term that models it, and the prefixes of this term's parameter names.
_SUSPECTS: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "the direction of motion": ("friction term coulomb", ("fc_", "fcp_", "fcn_")),
    "the speed": ("friction term viscous", ("fv_", "fvs_")),
    "a constant": ("friction term offset", ("fo_",)),
    "the cube of the speed": ("friction term cubic", ("f3_",)),
    "the cube root of the speed": ("friction term cube_root", ("fcr_",)),
    "friction that grows with the load": ("friction term load", ("cl_",)),
    "friction that is larger at low speed": ("friction term stribeck", ("fs_",)),
    "the acceleration": ("the rotor's mounting or its armature", ()),
    "the sine of its angle": ("gravity: a payload or a spring", ()),
    "the cosine of its angle": ("gravity: a payload or a spring", ()),
}
_ELSEWHERE: Final = (
    "the model has this term, but with another coefficient: check the joint's temperature and load"
)


@dataclass(frozen=True)
class JointDiagnosis:
    """Probable cause of one joint's error.

    Attributes:
        relative_percent: RMS error relative to the RMS torque [%]; NaN if the joint never moves.
        over_noise: RMS error relative to that of noise alone; None if the noise is not known.
        white_p: P-value of Ljung and Box's test for white residuals; NaN for too few values.
        suspect: The quantity that the error follows most; empty if no quantity is distinct.
        suspect_share: Fraction of the error's power that the quantity explains.
        remedy: The term that would model this error, or a note that the model already has this
            term.
    """

    joint: str
    relative_percent: float
    over_noise: float | None
    white_p: float
    suspect: str
    suspect_share: float
    remedy: str

    @property
    def sentence(self) -> str:
        """The diagnosis in one sentence."""
        if math.isnan(self.relative_percent):
            return f"{self.joint} does not move in this run, so its error is unknown."
        parts = [f"{self.joint}: error {self.relative_percent:.3g} % of the torque"]
        if self.over_noise is not None:
            parts.append(f"{self.over_noise:.2g} times the noise floor")
        if self.over_noise is not None and self.over_noise <= NEAR_FLOOR:
            parts.append("the model explains the torque down to the noise")
        elif self.suspect:
            parts.append(
                f"{100.0 * self.suspect_share:.0f} % of the error follows {self.suspect}"
                f" ({self.remedy})"
            )
        elif self.white_p < WHITE_P:
            parts.append("the residual is not noise, and follows none of the known quantities")
        elif not math.isnan(self.white_p):
            parts.append("the residual looks like noise")
        return "; ".join(parts) + "."


def diagnose(estimate: Estimate, validation: Validation) -> tuple[JointDiagnosis, ...]:
    """Diagnose the error of a validation, joint by joint.

    Args:
        estimate: The model.
        validation: The model's prediction of a run.
    """
    error = validation.measured_nm - validation.predicted_nm
    step_s = float(np.median(np.diff(validation.time_s)))
    stride = max(1, round(0.5 / (validation.cutoff_hz * step_s)))
    names = {*estimate.model.parameter_names, *estimate.model.nonlinear_names}
    found = []
    for j, joint in enumerate(estimate.robot.joint_names):
        counted = validation.counted[:, j]
        suspect, share = _suspect(validation, error, j, counted)
        noise = validation.noise_nm
        found.append(
            JointDiagnosis(
                joint=joint,
                relative_percent=float(validation.relative_percent[j]),
                over_noise=None if noise is None else float(validation.rms_nm[j] / noise[j]),
                white_p=ljung_box(error[counted, j][::stride]),
                suspect=suspect if share >= WORTH_TELLING else "",
                suspect_share=share,
                remedy=_remedy(names, joint, suspect),
            )
        )
    return tuple(found)


def ljung_box(residual: FloatArray) -> float:
    """Return the p-value of Ljung and Box's test that residuals are white.

    Args:
        residual: Shape (values,). Residuals, sampled so slowly that white noise in their band has
            independent samples.

    Returns:
        The p-value of Ljung and Box's (1978) Q over the first lags, by chi-squared; NaN for fewer
        than 40 values.
    """
    count = len(residual)
    if count < FEWEST_VALUES:
        return math.nan
    centred = residual - residual.mean()
    power = float(centred @ centred)
    if power == 0.0:
        return 1.0
    lags = np.arange(1, min(LAGS, count // 4) + 1)
    correlation = np.array([float(centred[k:] @ centred[:-k]) for k in lags]) / power
    q = count * (count + 2) * float(np.sum(correlation**2 / (count - lags)))
    return float(chdtrc(len(lags), q))


def _remedy(names: set[str], joint: str, suspect: str) -> str:
    cure, prefixes = _SUSPECTS[suspect]
    if any(f"{prefix}{joint}" in names for prefix in prefixes):
        return _ELSEWHERE
    return f"{cure} would model this"


def _suspect(
    validation: Validation, error: FloatArray, j: int, counted: BoolArray
) -> tuple[str, float]:
    """Return the quantity that a joint's error follows most, and its fraction of the power."""
    v, q = validation.velocity[counted, j], validation.position[counted, j]
    rest = error[counted, j]
    total = float(rest @ rest)
    if len(rest) < FEWEST_VALUES or total == 0.0:
        return "a constant", 0.0
    sign = np.sign(v)
    shapes = {
        "the direction of motion": sign,
        "the speed": v,
        "a constant": np.ones_like(v),
        "the cube of the speed": v**3,
        "the cube root of the speed": np.cbrt(v),
        "friction that grows with the load": sign * np.abs(validation.predicted_nm[counted, j]),
        "friction that is larger at low speed": sign * np.exp(-np.abs(v) / STRIBECK_RAD_S),
        "the acceleration": validation.acceleration[counted, j],
        "the sine of its angle": np.sin(q),
        "the cosine of its angle": np.cos(q),
    }
    shares = {
        words: float(rest @ shape) ** 2 / (total * max(float(shape @ shape), 1e-300))
        for words, shape in shapes.items()
    }
    best = max(shares, key=lambda words: shares[words])
    return best, shares[best]
