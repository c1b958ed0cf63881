"""`MistakeEntry`: a mistake of wiring, units or files, and the lines to change."""

from __future__ import annotations

from identification.wiring.mistakes import MistakeKind
from rid_daq.report.sections.section import Numbers, Section, Texts


class PlaceToChange(Section):
    """A line of a file that says what does not hold.

    Attributes:
        file, line: Where the key stands, or where what it belongs to begins.
        stated: Whether it stands there; else it is to be added.
        text: What the line says; left out where it is to be added, or the file has changed since
            the run.
        remark: What a person should know of the file, such as that it has changed since the run.
        words: All that as one line.
    """

    file: str
    line: int
    key: str
    stated: bool
    remark: str
    words: str
    text: str | None = None


class Explanation(Section):
    """What may be wrong, and what to change then.

    Attributes:
        kind: What is wrong.
        joints: Of which joints; none where all are meant.
        factor: What the stated numbers must be multiplied with, or have added [rad] where a zero
            position is wrong.
        words: What is wrong, in words.
        change: The keys to change, file by file.
        places: The lines that they stand in; left out if they were not looked for.
    """

    kind: MistakeKind
    joints: Texts
    factor: float
    words: str
    change: Texts
    places: tuple[PlaceToChange, ...] | None = None


class MistakeEntry(Explanation):
    """The best explanation, and what explains the data as well.

    Attributes:
        times_better: By which factor the residual falls where it falls most.
        sentence: The finding in words.
        alternatives: What else would explain the data as well.
    """

    times_better: float
    sentence: str
    alternatives: tuple[Explanation, ...]


class ArmWeightEntry(Section):
    """Gravity's torque by the fit, over that of the arm as drawn.

    Attributes:
        share, std: The ratio, and its standard deviation.
        plausible: Its smallest and largest value that a real arm has.
        is_drawn, is_plausible: True if `cad` says the weight and not the arm's size alone; true if
            the ratio is possible.
    """

    share: float
    std: float
    plausible: Numbers
    is_drawn: bool
    is_plausible: bool
