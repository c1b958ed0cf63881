"""`MistakeEntry`: a mistake in files or wiring that explains a run far better."""

from __future__ import annotations

from identification.wiring.mistakes import Kind
from rid_daq.report.sections.section import Section, Texts


class Explanation(Section):
    """What may be wrong, and what to change then.

    Attributes
    ----------
    kind : Kind
        What is wrong.
    joints : tuple of str
        Of which joints; none where all are meant.
    factor : float
        What the stated numbers must be multiplied with, or have added [rad] where a zero position
        is wrong.
    words : str
        What is wrong, in words.
    change : tuple of str
        The keys to change, file by file.
    """

    kind: Kind
    joints: Texts
    factor: float
    words: str
    change: Texts


class MistakeEntry(Explanation):
    """The best explanation, and what explains the data as well.

    Attributes
    ----------
    times_better : float
        By which factor the residual falls where it falls most.
    sentence : str
        The finding in words.
    alternatives : tuple of Explanation
        What else would explain the data as well.
    """

    times_better: float
    sentence: str
    alternatives: tuple[Explanation, ...]
