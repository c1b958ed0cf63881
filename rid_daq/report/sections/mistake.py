"""`MistakeEntry`: a mistake in files or wiring that explains a run far better."""

from __future__ import annotations

from identification.wiring.mistakes import Kind
from rid_daq.report.sections.section import Section, Texts


class MistakeEntry(Section):
    """One mistake, and what to change.

    Attributes
    ----------
    kind : Kind
        What is wrong.
    joints : tuple of str
        Of which joints; none where all are meant.
    factor : float
        What the stated numbers must be multiplied with, or have added [rad] where a zero position
        is wrong.
    times_better : float
        By which factor the residual falls where it falls most.
    sentence : str
        The finding in words.
    change : tuple of str
        The keys to change, file by file.
    alternatives : tuple of str
        What else would explain the data as well.
    """

    kind: Kind
    joints: Texts
    factor: float
    times_better: float
    sentence: str
    change: Texts
    alternatives: Texts
