"""`MistakeEntry`: a mistake in wiring, units or files, and the lines to change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from identification.wiring.file_entries import (
    POSITION_FACTOR,
    SCALE_ERROR,
    ZERO_ERROR_DEG,
    EntryKind,
    UnconfirmedEntry,
)
from identification.wiring.mistakes import MistakeKind
from rid_daq.report.sections.section import Numbers, Section, Texts

if TYPE_CHECKING:
    from identification.wiring.moved_mass import MovedMass
    from identification.wiring.weight import ArmWeight

DRAWN_ERROR: Final = 0.2
"""Relative difference between an arm's weight and that of `cad` up to which no remark is made."""


class PlaceToChange(Section):
    """A line of a file that states a wrong value, or to which a missing key belongs.

    Attributes:
        file: File that contains the key, or the object to which the key must be added.
        line: Line of the key; if the key is missing, the first line of that object.
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

    @classmethod
    def of(cls, weight: ArmWeight) -> ArmWeightEntry:
        """Return the section of an arm's weight."""
        return cls.from_attributes(weight, std=weight.sigma)

    @property
    def differs(self) -> bool:
        """True if the weight is possible, but distinctly differs from that of `cad`."""
        low, high = self.share - 2.0 * self.std, self.share + 2.0 * self.std
        far = low > 1.0 + DRAWN_ERROR or high < 1.0 / (1.0 + DRAWN_ERROR)
        return self.is_drawn and self.is_plausible and far


class MovedMassEntry(Section):
    """Moving mass and holding force of a prismatic joint.

    Attributes:
        joint: Name of the joint.
        mass_kg: Mass that the joint's force accelerates, with the inertia of the rotor [kg].
        std_kg: Standard deviation of the mass [kg].
        held: Force that holds the joint against gravity, relative to the weight of this mass; null
            if gravity does not load the joint or loads it by a force that varies with the pose, if
            the robot file states a spring or a counterbalance, or if the mass is not positive.
        held_std: Standard deviation of `held`, with that of a friction offset.
        drawn: The mass relative to that of the links in `cad`; null without `cad`.
        drawn_std: Standard deviation of `drawn`.
        is_plausible: True if neither the weight nor the mass is impossible.
        has_rotor: True if the mass contains the inertia of a rotor.
    """

    joint: str
    mass_kg: float
    std_kg: float
    held: float | None
    held_std: float | None
    drawn: float | None
    drawn_std: float | None
    is_plausible: bool
    has_rotor: bool = True

    @classmethod
    def of(cls, moved: MovedMass) -> MovedMassEntry:
        """Return the section of a joint's moving mass."""
        return cls.from_attributes(
            moved, std_kg=moved.sigma_kg, held_std=moved.held_sigma, drawn_std=moved.drawn_sigma
        )

    @property
    def differs(self) -> bool:
        """True if the mass is possible, but distinctly differs from that of the links in `cad`.

        A mass that is too large does not count if it contains the inertia of a rotor.
        """
        if self.drawn is None or self.drawn_std is None or not self.is_plausible:
            return False
        low, high = self.drawn - 2.0 * self.drawn_std, self.drawn + 2.0 * self.drawn_std
        is_heavy = low > 1.0 + DRAWN_ERROR and not self.has_rotor
        return is_heavy or high < 1.0 / (1.0 + DRAWN_ERROR)


class UnconfirmedSection(Section):
    """Values of one kind in the robot or cell file that the recordings do not confirm.

    The recordings would fit as well if these values were wrong.

    Attributes:
        kind: Kind of the values.
        joints: Joints to which the values belong; empty if they belong to the whole robot.
        words: The values and, for some kinds, the size of an error that the recordings would not
            show, as text.
    """

    kind: EntryKind
    joints: Texts
    words: str

    @classmethod
    def of(cls, entry: UnconfirmedEntry, joint_names: Sequence[str]) -> UnconfirmedSection:
        """Return the section of entries of one kind."""
        names = tuple(joint_names[number] for number in entry.numbers)
        every = len(names) == len(joint_names)
        listed = "every joint" if every else join_words(names)
        rows = " and ".join(f"row {number + 1}" for number in entry.numbers)
        scale, zero = f"error of {100.0 * SCALE_ERROR:g} %", f"error of {ZERO_ERROR_DEG:g}°"
        factor = f"factor of {POSITION_FACTOR:g}"
        words = {
            EntryKind.LENGTHS: f"the lengths in the kinematic table ({scale})",
            EntryKind.TWISTS: f"the sign of `alpha_rad` in {rows}",
            EntryKind.DIRECTION: f"the direction of {listed}",
            EntryKind.ZERO_POSITION: f"the zero position of {listed} ({zero})",
            EntryKind.POSITION_SCALE: f"the scale of the position of {listed} ({factor})",
            EntryKind.TORQUE_SCALE: f"the scale of the torque of {listed} ({scale})",
            EntryKind.COMMON_TORQUE_SCALE: "a common factor of all torques, because the robot file"
            " has no `cad`",
        }
        return cls(kind=entry.kind, joints=names, words=words[entry.kind])


def join_words(words: Sequence[str]) -> str:
    """Return words as a list in a sentence, such as `a, b and c`."""
    return " and ".join([*([", ".join(words[:-1])] if words[:-1] else []), *words[-1:]])
