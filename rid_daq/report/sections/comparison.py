"""`ComparisonSection`: candidates of friction terms, and which was chosen for each joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rid_daq.report.formats import number
from rid_daq.report.sections.section import Numbers, Section, Texts
from rid_daq.terminal.console import Console

if TYPE_CHECKING:
    from identification.validation.friction_selection import Comparison


class FrictionTrial(Section):
    """One candidate.

    Attributes
    ----------
    terms : tuple of str
        Friction of every joint; empty where each joint has its own.
    error : tuple of float
        RMS error on what the fit left out, one a joint [N m or N].
    parameters : int
        Their number.
    aic, bic : float
        Akaike's and the Bayesian information criterion.
    """

    terms: Texts
    error: Numbers
    parameters: int
    aic: float
    bic: float


class ComparisonSection(Section):
    """How candidates of friction terms compare, and what was chosen.

    Attributes
    ----------
    joints : tuple of str
        The joints' names.
    chosen : dict of tuple of str
        The terms of each joint, by its name.
    trials : tuple of FrictionTrial
        The candidates, and last what was chosen, all joints together.
    """

    joints: Texts
    chosen: dict[str, Texts]
    trials: tuple[FrictionTrial, ...]

    @classmethod
    def of(cls, comparison: Comparison) -> ComparisonSection:
        """Return how candidates compare."""
        return cls(
            joints=comparison.joint_names,
            chosen=dict(zip(comparison.joint_names, comparison.chosen, strict=True)),
            trials=tuple(
                FrictionTrial.taken(trial, error=trial.error_nm)
                for trial in (*comparison.trials, comparison.combined)
            ),
        )

    def print(self, console: Console) -> None:
        """Print the candidates, and what each is chosen for."""
        console.say("Friction terms, judged on parts of the runs that each fit left out:")
        console.table(
            ("friction terms", *self.joints, "AIC", "BIC", "chosen for"),
            [
                (
                    ", ".join(trial.terms) or "each joint its own",
                    *(number(error, 4) for error in trial.error),
                    f"{trial.aic:.0f}",
                    f"{trial.bic:.0f}",
                    ", ".join(joint for joint in self.joints if self.chosen[joint] == trial.terms),
                )
                for trial in self.trials
            ],
        )
        console.say(
            "RMS error on moving samples [N m or N]. Each joint has the simplest terms within one"
            " standard error of its best."
        )
