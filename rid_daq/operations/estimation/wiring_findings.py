"""`WiringDiagnosis`: mistakes found in runs, and physically impossible properties of the runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from identification.wiring.file_entries import UnconfirmedEntry
from identification.wiring.mistakes import MistakeKind
from identification.wiring.moved_mass import MovedMass
from identification.wiring.weight import ArmWeight
from rid_daq.report.mistake_entry import MistakeEntry, join_words

OTHER_ROBOT: Final = (
    "Compare lengths, axes and zero positions in the robot file with the robot: the file may"
    " describe another robot."
)


@dataclass(frozen=True)
class WiringDiagnosis:
    """Mistakes of wiring, units and files found in runs.

    Attributes:
        mistakes: Probable mistakes; None without a search.
        driving: Joints with negative friction power; None if this was not checked.
        weight: Weight of the arm, computed from torques; None if the torques do not determine it.
        masses: Moving mass and holding force of each prismatic joint.
        unconfirmed: Entries of the files that the runs do not confirm; None if not examined.
        late_s: Delay of all torques that a bus can explain; negative if they are early [s].
    """

    mistakes: tuple[MistakeEntry, ...] | None = None
    driving: tuple[str, ...] | None = None
    weight: ArmWeight | None = None
    masses: tuple[MovedMass, ...] = ()
    unconfirmed: tuple[UnconfirmedEntry, ...] | None = None
    late_s: float = 0.0

    @property
    def are_all_late(self) -> bool:
        """True if all torques are late or early, whether a bus can explain it or not."""
        kinds = {each.kind for each in self.mistakes or ()}
        return bool(self.late_s) or MistakeKind.TORQUE_TIME in kinds

    @property
    def late_sentences(self) -> tuple[str, ...]:
        """Sentence on torques whose delay a bus can explain; empty without one."""
        if not self.late_s:
            return ()
        cause = "a bus or a filter" if self.late_s > 0.0 else "a bus"
        return (
            f"All recorded torques are {delay_words(self.late_s)}; {cause} can explain this. The"
            " parameters contain the effect: estimate it with `identify --choose`, or correct the"
            " time stamps.",
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on physically impossible properties of the runs."""
        sentences = []
        if self.driving:
            sentences.append(
                f"The friction of {join_words(list(self.driving))} has negative power, which is"
                " physically impossible: look for a wrong sign of torque or position, or for"
                " swapped axes."
            )
        if self.weight is not None and not self.weight.is_plausible:
            words = self.weight.sentence
            sentences.append(
                f"{words[0].upper()}{words[1:]}: look for a wrong torque unit, for torques"
                f" without gravity, or for wrong masses in `cad`. {self._lifted}{OTHER_ROBOT}"
            )
        masses = (each for each in self.masses if each.joint not in (self.driving or ()))
        of_masses = [each.sentence for each in masses if each.sentence]
        return (*sentences, *(f"{each[0].upper()}{each[1:]}." for each in of_masses))

    @property
    def _lifted(self) -> str:
        """Remedy for a weight that a cylinder or counterweight carries; empty if none can."""
        joints = [each.joint for each in self.masses if each.held is not None]
        if not joints or (self.weight is not None and self.weight.share > self.weight.plausible[1]):
            return ""
        return (
            f"If a cylinder or counterweight carries the weight on {join_words(joints)}, write"
            " `counterbalanced: true` for this joint in the robot file. "
        )


def delay_words(delay_s: float) -> str:
    """Return a delay in words; a negative one is early."""
    return f"about {1e3 * abs(delay_s):.0f} ms {'late' if delay_s > 0.0 else 'early'}"
