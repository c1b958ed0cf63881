"""`TruthCase`: an estimate of a simulated robot against the truth."""

from __future__ import annotations

from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.section import Numbers, Section


class TruthCase(Section):
    """How the parameters of one simulated robot compare with the truth.

    Attributes
    ----------
    title, sentence : str
        Which robot, and what was found.
    inside, of : int
        Parameters inside their two-sigma intervals, of so many.
    deviation_sigmas : tuple of float
        How far each is off, in standard deviations.
    """

    title: str
    sentence: str
    inside: int
    of: int
    deviation_sigmas: Numbers

    @classmethod
    def compared(cls, title: str, estimate: EstimateSection) -> TruthCase:
        """Return how an estimate whose truth is known compares with it."""
        parameters = [each for each in estimate.parameters if each.deviation_sigmas is not None]
        inside = sum(bool(each.inside_two_sigma) for each in parameters)
        return cls(
            title=title,
            sentence=f"{title}: {inside} of {len(parameters)} true values lie inside the two-sigma"
            f" interval ({100.0 * inside / len(parameters):.0f} %).",
            inside=inside,
            of=len(parameters),
            deviation_sigmas=tuple(each.deviation_sigmas or 0.0 for each in parameters),
        )
