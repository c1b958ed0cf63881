"""`MistakeEntry`: a mistake in wiring, units or files, and the lines to change."""

from __future__ import annotations

from identification.wiring.mistakes import MistakeKind
from rid_daq.report.sections.section import Numbers, Section, Texts


class PlaceToChange(Section):
    """A line of a file that states a wrong value, or to which a missing key belongs.

    Attributes:
        file, line: Position of the key. If the key is missing: first line of the object that it
            belongs to.
        stated: True if the file contains the key; False if the key must be added.
        text: Text of the line. Left out if the key must be added, or if the file has changed since
            the run.
        remark: Remark on the file, such as that it has changed since the run.
        words: File, line, key, text and remark as one line of text.
    """

    file: str
    line: int
    key: str
    stated: bool
    remark: str
    words: str
    text: str | None = None


class Explanation(Section):
    """One possible mistake, and how to correct it.

    Attributes:
        kind: Kind of mistake.
        joints: Joints that the mistake affects; empty if it affects all joints.
        factor: Factor by which the stated numbers must be multiplied. For a wrong zero position:
            the angle that must be added [rad].
        words: Description of the mistake.
        change: Keys to change, one entry per file.
        places: Lines that contain these keys; left out if the program did not search for them.
    """

    kind: MistakeKind
    joints: Texts
    factor: float
    words: str
    change: Texts
    places: tuple[PlaceToChange, ...] | None = None


class MistakeEntry(Explanation):
    """The best explanation of a misfit, and other explanations that fit the data equally well.

    Attributes:
        times_better: Factor by which the correction reduces the residual of the joint that improves
            most.
        sentence: The finding in words.
        alternatives: Other mistakes that explain the data equally well.
    """

    times_better: float
    sentence: str
    alternatives: tuple[Explanation, ...]


class ArmWeightEntry(Section):
    """Gravity torque of the fitted model relative to that of the arm in the robot file.

    Attributes:
        share: The ratio of the two torques.
        std: Standard deviation of the ratio.
        plausible: Smallest and largest ratio that a real arm can have.
        is_drawn: True if the robot file states the arm's weight (`cad`). False if the expected
            weight follows from the size of the arm alone.
        is_plausible: True if the ratio is possible.
    """

    share: float
    std: float
    plausible: Numbers
    is_drawn: bool
    is_plausible: bool
