"""`Result`: every number of a run's report, in one document that commands add sections to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from pydantic import Field

from rid_daq.report.model_file import BY_MODEL, ModelFile
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.friction import FrictionSection
from rid_daq.report.sections.payload import PayloadSection
from rid_daq.report.sections.plate import PlateSection
from rid_daq.report.sections.plate_zero import PlateZeroSection
from rid_daq.report.sections.reaction import BaseLoadSection, ReactionSection
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.section import Section, Texts
from rid_daq.report.sections.timing import Timing
from rid_daq.report.sections.tracking import TrackingSection
from rid_daq.report.sections.validation import TruthCase, ValidationSection
from rid_daq.report.sections.velocity_loops import VelocityLoopsSection
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.session.versions import software_versions

SCHEMA: Final = "rid-daq result 1"


_NOT_SECTIONS: Final = (
    *("format", "title", "robot", "verdict", "software", "notes", "cell", "model", "seed"),
    "without_unmodelled",
)
NOTHING_JUDGED: Final = VerdictSection.of([], "Nothing to judge", "No limit was set for this run.")


class WithoutUnmodelled(Section):
    """The demo on a robot without the effects that no model has."""

    average: AverageSection
    estimate: EstimateSection
    validation: ValidationSection


class Result(Section):
    """A run's result, as `result.json` holds it.

    All sections but the first five keys are left out where nothing was computed. What differs from
    one execution to the next (run ids, clock times, loop timing) stands under `timing` and nowhere
    else, so that two simulated runs with the same seed agree in all the rest, bit for bit. Their
    order here is their order on the page.

    Attributes:
        format: The version of this document, under the key `schema`.
        title, robot: What was done, and the robot's name.
        verdict: Whether the result holds.
        software: Versions of what it was made with, by name.
        notes: What the runs lack that it rests on.
        cell: The cell that it was recorded on.
        model: The model that the sections `validation`, `curves`, `estimate`, `plate`,
            `comparison`, `reaction` and `base_load` are of, all of them.
        seed: Of the demo.
        without_unmodelled: Of the demo.
        timing: All that differs from one execution to the next.
    """

    format: Literal["rid-daq result 1"] = Field(default=SCHEMA, alias="schema")
    title: str
    robot: str
    verdict: VerdictSection
    software: dict[str, str]
    notes: Texts | None = None
    cell: CellSection | None = None
    model: ModelFile | None = None
    seed: int | None = None

    payload: PayloadSection | None = None
    validation: ValidationSection | None = None
    curves: CurvesSection | None = None
    estimate: EstimateSection | None = None
    plate: PlateSection | None = None
    comparison: ComparisonSection | None = None
    truth: tuple[TruthCase, ...] | None = None
    tracking: TrackingSection | None = None
    plate_zero: PlateZeroSection | None = None
    reaction: ReactionSection | None = None
    base_load: BaseLoadSection | None = None
    friction: FrictionSection | None = None
    retiming: RetimingSection | None = None
    velocity_loops: VelocityLoopsSection | None = None
    runs: tuple[RunSection, ...] | None = None
    average: AverageSection | None = None

    without_unmodelled: WithoutUnmodelled | None = None
    timing: Timing | None = None

    @classmethod
    def new(cls, title: str, robot: str) -> Result:
        """Return a result with nothing judged yet, made by this program.

        Args:
            title: What was done.
            robot: The robot's name.
        """
        return cls(
            title=title,
            robot=robot,
            verdict=NOTHING_JUDGED,
            software=software_versions(),
        )

    def updated(self, **sections: object) -> Result:
        """Return the document with sections (or title, verdict, notes) replaced or added.

        Raises:
            pydantic.ValidationError: A section is not of its class, or there is no such section.
        """
        own = {name: getattr(self, name) for name in type(self).model_fields if name != "format"}
        return Result.model_validate({**own, **sections})

    def by_model(self, model: ModelFile, **sections: object) -> Result:
        """Return the document with sections by a model; those of another model are left out.

        A verdict on another model goes with it, unless `sections` hold a new one.

        Args:
            model: The model that the sections are of.
            **sections: The sections, and whatever else is replaced.
        """
        if self.model == model:
            return self.updated(**sections)
        gone = [name for name in BY_MODEL if getattr(self, name) is not None]
        gone = [name for name in gone if sections.get(name) is None]
        judged = {"validation", "base_load"} & set(gone)
        cleared: dict[str, object] = {}
        cleared.update(dict.fromkeys(BY_MODEL))
        if judged:
            title, older = f"Model of {self.robot}", self.model or "an older model"
            words = ", ".join(name.replace("_", " ") for name in gone)
            note = f"what was of {older} is left out ({words}): validate the new model"
            cleared |= {"title": title, "verdict": NOTHING_JUDGED}
            cleared |= {"notes": (*(self.notes or ()), note)}
        return self.updated(**{**cleared, **sections, "model": model})

    def sections(self) -> Iterator[tuple[str, Section]]:
        """Yield the sections that are there, and their names, in the order of the page."""
        for name in type(self).model_fields:
            section = getattr(self, name)
            if section is not None and name not in _NOT_SECTIONS:
                yield name, section
