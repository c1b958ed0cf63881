"""`Result`: all numbers of a run's report, in one document to which commands add sections."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from pydantic import Field, JsonValue

from rid_daq.report.elastic_path_entry import ElasticPathSection
from rid_daq.report.model_file import BY_MODEL, ModelFile
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.report.sections.curves import CurvesSection
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.friction import FrictionSection
from rid_daq.report.sections.gears import GearsSection
from rid_daq.report.sections.payload import PayloadSection
from rid_daq.report.sections.plate import BaseLoadSection, PlateSection, ReactionSection
from rid_daq.report.sections.plate_zero import PlateZeroSection
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
    """Results of the demo on a simulated robot without unmodelled effects."""

    average: AverageSection
    estimate: EstimateSection
    validation: ValidationSection


class Result(Section):
    """Result of a run, as `result.json` contains it.

    Only the first five keys are always present; a section that was not computed is left out. Clock
    times, loop timing and most run ids are under `timing`. Two demos with the same seed therefore
    agree in everything else.
    The sections have the same order here and on the page.

    Attributes:
        format: Version of this document, under the key `schema`.
        title: Title of the report.
        robot: Name of the robot.
        verdict: The verdict: passed, failed, or not judged.
        software: Versions of the software that made the result, by name.
        notes: Deficiencies of the runs that the result is based on.
        cell: The cell that recorded the data.
        model: Model that the sections `validation`, `curves`, `estimate`, `plate`, `comparison`,
            `reaction` and `base_load` refer to.
        seed: Random seed of the demo.
        payload: The payload, with intervals and findings.
        validation: Torque errors of every axis, with their limits.
        curves: Curves over time and frequency, such as measured and predicted torques.
        estimate: The identified parameters, with intervals and findings.
        plate: Fit of the force plate's signals.
        comparison: Comparison of the chosen friction model with the plain one.
        truth: Comparison of the estimate with the simulated robot's true parameters.
        tracking: Path errors.
        plate_zero: Offsets and drifts of the force plate.
        reaction: Errors of the predicted base wrench.
        base_load: Predicted load on the floor, compared with its limits.
        friction: Measured friction, and the fitted friction models.
        elastic_path: A path on elastic gears, without and with correction of the deflection.
        retiming: The timed path, and the limits that it reaches.
        velocity_loops: The drives' velocity loops, with margins.
        gears: Stiffness and damping of the gears.
        runs: The recorded runs: extremes, lost rows, stop reason.
        average: Averaged periods and noise.
        without_unmodelled: Results of the demo on a robot without unmodelled effects.
        timing: Clock times, loop timing, run ids, and other values of one execution.
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
    elastic_path: ElasticPathSection | None = None
    retiming: RetimingSection | None = None
    velocity_loops: VelocityLoopsSection | None = None
    gears: GearsSection | None = None
    runs: tuple[RunSection, ...] | None = None
    average: AverageSection | None = None

    without_unmodelled: WithoutUnmodelled | None = None
    timing: Timing | None = None

    @classmethod
    def new(cls, title: str, robot: str) -> Result:
        """Return a result of this program without sections and without a verdict.

        Args:
            title: Title of the report.
            robot: Name of the robot.
        """
        return cls(
            title=title,
            robot=robot,
            verdict=NOTHING_JUDGED,
            software=software_versions(),
        )

    def with_sections(self, **sections: object) -> Result:
        """Return the document with some sections (or title, verdict, notes) replaced or added.

        Raises:
            pydantic.ValidationError: A section has a wrong class, or a name is unknown.
        """
        own = {name: getattr(self, name) for name in type(self).model_fields if name != "format"}
        return Result.model_validate({**own, **sections})

    def with_model_sections(self, model: ModelFile, **sections: object) -> Result:
        """Return the document with sections that refer to a model.

        Sections that refer to another model are removed. If one of them is a validation or a base
        load, the verdict is removed too, unless `sections` contains a new one.

        Args:
            model: Model that the sections refer to.
            **sections: The sections, and other fields to replace.
        """
        if self.model == model:
            return self.with_sections(**sections)
        gone = [name for name in BY_MODEL if getattr(self, name) is not None]
        gone = [name for name in gone if sections.get(name) is None]
        judged = {"validation", "base_load"} & set(gone)
        cleared: dict[str, object] = {}
        cleared.update(dict.fromkeys(BY_MODEL))
        if judged:
            title, older = f"Model of {self.robot}", self.model or "an older model"
            words = ", ".join(name.replace("_", " ") for name in gone)
            note = f"the sections of {older} were removed ({words}): validate the new model"
            cleared |= {"title": title, "verdict": NOTHING_JUDGED}
            cleared |= {"notes": (*(self.notes or ()), note)}
        return self.with_sections(**{**cleared, **sections, "model": model})

    @property
    def facts(self) -> dict[str, JsonValue]:
        """Facts for lists of runs: verdict, and the model and the runs that the result uses."""
        runs = None if self.timing is None else self.timing.run_ids
        return {
            "verdict": self.verdict.word,
            "headline": self.verdict.headline,
            "used_model": None if self.model is None else self.model.sha256,
            "used_runs": list(runs or ()),
        }

    def sections(self) -> Iterator[tuple[str, Section]]:
        """Yield name and content of each section that is present, in the order of the page."""
        for name in type(self).model_fields:
            section = getattr(self, name)
            if section is not None and name not in _NOT_SECTIONS:
                yield name, section
