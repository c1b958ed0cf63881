"""`BaseLoadSection`: the largest reaction of a motion on the base, against its limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from rid_daq.report.formats import measured
from rid_daq.report.sections.section import Section
from rid_daq.report.sections.verdict import Check
from rid_daq.terminal.console import Console

if TYPE_CHECKING:
    from identification.calibration.base_reaction import BaseLoad


class LoadComponent(Section):
    """One component at its largest, in `unit`.

    Attributes
    ----------
    name, unit : str
        The component.
    peak, std, limit : float
        Its largest size, the standard deviation of that, and what is allowed.
    at_s : float
        When [s].
    held : bool
        Whether the limit holds, two standard deviations included.
    """

    name: str
    unit: str
    peak: float
    std: float
    at_s: float
    limit: float
    held: bool


class BaseLoadSection(Section):
    """What a motion does to the floor.

    Attributes
    ----------
    sentence : str
        In words.
    weight_known : bool
        Whether the standing weight is in it.
    components : tuple of LoadComponent
        One a component.
    """

    sentence: str
    weight_known: bool
    components: tuple[LoadComponent, ...]

    @classmethod
    def of(cls, load: BaseLoad, more: str = "") -> BaseLoadSection:
        """Return the largest reaction of a motion against its limits; `more` is a sentence."""
        return cls(
            sentence=load.sentence + more,
            weight_known=load.weight_known,
            components=LoadComponent.for_each(
                name=WRENCH_NAMES,
                unit=WRENCH_UNITS,
                peak=load.peak,
                std=load.sigma,
                at_s=load.at_s,
                limit=load.limit,
                held=load.held,
            ),
        )

    @property
    def checks(self) -> list[Check]:
        """The lines of a verdict on limits of the base."""
        return [
            Check.of(
                f"reaction on the base with 2σ, {each.name}",
                each.peak + 2.0 * each.std,
                "≤",
                each.limit,
                each.unit,
            )
            for each in self.components
        ]

    def print(self, console: Console) -> None:
        """Print what the motion does to the floor."""
        console.table(
            ("reaction", "largest", "± 2σ", "unit", "limit", "holds"),
            [
                (
                    each.name,
                    *measured(each.peak, 2.0 * each.std),
                    each.unit,
                    f"{each.limit:g}",
                    "yes" if each.held else "NO",
                )
                for each in self.components
            ],
            red=[not each.held for each in self.components],
        )
