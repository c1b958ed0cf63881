"""`payload session`: guided session from the preflight to a payload with its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field, JsonValue

from config.errors import ConfigError
from config.ranges import Periods, Repeats, Seed, WarmUpPeriods
from identification.choices import RehearsalPercent, UntilMassKg, WarmUpPercent
from rid_daq.blocks.block import AnyBlock, Next, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.payload.payload_identify import KnownQuantity, VerdictLimits
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.requests.cell_options import (
    BEFORE,
    SIMULATED,
    AxisTest,
    Cleared,
    Live,
    Practise,
    SimulatedPace,
    SimulatedPayload,
)
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CellName,
    DespiteMisfitOfModel,
    Option,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.recording.recorded_run import RecordedRun

LENGTHS: Final = "Steps and durations"
UNLOADED: Final = "unloaded"
LOADED: Final = "loaded"

_OF_SESSION: Final = frozenset(
    {
        *("repeats", "model", "payload", "known", "until_mass_kg", "limits", "label", "seed"),
        *("practise", "despite_misfit"),
        *("rehearsal_percent", "warm_up_percent", "warm_up_periods"),
    }
)
"""Fields that a resumed session keeps from its beginning; its folder contains its motion."""


class PayloadSessionRequest(Request):
    """Lead through a payload session: check, rehearse, warm up, record, attach, record, identify.

    An interrupted session is continued with --resume: its motion and its recorded runs are used,
    and its original options apply unless they are given again. Confirmations, --without-axis-test
    and --pace are not kept: give them again.

    In a terminal: exit code 1 if the payload fails its verdict, 6 if a run is not good enough or
    the torque of an axis is not explained.
    """

    cell: CellName
    motion: Annotated[
        Path | None,
        Field(description="Periodic motion file; if not set, a motion is designed."),
        Option(metavar="MOTION", file="input"),
    ] = None
    model: Annotated[
        Path | None,
        Field(description="Model file of the robot, instead of the run without payload."),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfitOfModel = False
    known: Annotated[
        tuple[KnownQuantity, ...],
        Field(
            description="Quantity that is known from another measurement, such as m=2.805+-0.005."
        ),
        Option(metavar="NAME=VALUE[±SIGMA]"),
    ] = ()
    resume: Annotated[
        str | None,
        Field(description="Continue an interrupted session: its folder, id or label, or `latest`."),
        Option(metavar="SESSION"),
    ] = None
    periods: Annotated[
        Periods,
        Field(
            description="Largest number of periods measured in each run of a designed motion; a"
            " motion file and a resumed session contain their own number."
        ),
        Option(group=LENGTHS, unused_with=("motion", "resume")),
    ] = 18
    repeats: Annotated[
        Repeats, Field(description="Number of runs with the payload."), Option(group=LENGTHS)
    ] = 1
    until_mass_kg: Annotated[
        UntilMassKg | None,
        Field(description="End a run with the payload when 2σ of the mass is at most this value."),
        Option(group=LENGTHS, flag="until-mass", unit="kg"),
    ] = None
    rehearsal_percent: Annotated[
        RehearsalPercent,
        Field(description="Relative speed of a first, slow period (rehearsal); 0 skips it."),
        Option(group=LENGTHS, flag="rehearsal", unit="%"),
    ] = 25.0
    warm_up_percent: Annotated[
        WarmUpPercent,
        Field(
            description="End the warm-up when friction changes by less than this per period; 0"
            " skips the warm-up."
        ),
        Option(group=LENGTHS, flag="warm-up", unit="%"),
    ] = 1.0
    warm_up_periods: Annotated[
        WarmUpPeriods,
        Field(description="Largest number of periods of the warm-up."),
        Option(group=LENGTHS),
    ] = 30
    limits: VerdictLimits = Field(default_factory=VerdictLimits)
    yes: Annotated[
        bool,
        Field(
            description="Answer all questions with yes: the cell is clear, the flange is empty"
            " before the payload is attached, and the payload is attached."
        ),
        Option(group=BEFORE),
    ] = False
    cleared: Cleared = False
    axis_test: AxisTest = "required"
    practise: Practise = False
    payload: Annotated[SimulatedPayload, Option(group=SIMULATED, metavar="NAME")] = None
    pace: SimulatedPace = None
    seed: Annotated[
        Seed,
        Field(description="Random seed of the designed motion and of a simulated cell."),
        Option(group=SIMULATED),
    ] = 0
    live: Annotated[Live, Option(owned=True)] = Live()
    label: Annotated[
        str, Field(description="Name of the session and of its runs."), Option(group=FILES)
    ] = "payload"
    runs: RunsFolder = DEFAULT_RUNS

    @property
    def choices(self) -> dict[str, JsonValue]:
        """Options that a session keeps from its beginning, as JSON."""
        found = self.model_dump(mode="json", include=set(_OF_SESSION))
        if self.model is not None:
            found["model"] = str(self.model.absolute())
        return found

    def with_original_options(self, begun: Mapping[str, JsonValue]) -> PayloadSessionRequest:
        """Return the request of a resumed session: original options, overridden by new ones.

        Args:
            begun: Original options, as `choices` returned them.

        Raises:
            ConfigError: `begun` is not of a payload session (RID-SESSION-STATE).
        """
        now = self.model_dump(mode="json", exclude_unset=True)
        limits: dict[str, object] = {}
        for each in (begun, now):
            found = each.get("limits")
            limits |= found if isinstance(found, dict) else {}
        try:
            return PayloadSessionRequest.of_json({**begun, **now, "limits": limits})
        except ConfigError as error:
            raise ConfigError(
                f"--resume {self.resume}: its file is not the file of a payload session: {error};"
                " was the file edited?",
                code="RID-SESSION-STATE",
            ) from None

    @property
    def measured_steps(self) -> tuple[str, ...]:
        """Steps that record the runs from which the payload is estimated."""
        loaded = tuple(f"{LOADED} {i + 1}" for i in range(self.repeats))
        return (UNLOADED, *loaded) if self.model is None else loaded


@dataclass(frozen=True)
class StoppedSession:
    """A session that can be resumed: a step was stopped, or its run is not good enough.

    Attributes:
        step: Name of the step.
        run: Run of the step.
        resume: Command that continues the session.
    """

    step: str
    run: RecordedRun
    resume: tuple[str, ...]

    @property
    def exit_code(self) -> int:
        """Exit code of the run."""
        return self.run.exit_code

    def document(self) -> dict[str, object]:
        """Return the step, the folder of its run, and the reason why it failed."""
        from rid_daq.recording.recorded_run import stop_document

        run = self.run
        document: dict[str, object] = {"step": self.step, "folder": str(run.folder.path)}
        if run.outcome.stop is not None:
            return document | stop_document(run.outcome)
        return document if run.quality is None else document | {"quality": run.quality.to_dict()}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the reason why the step failed, and the command that continues."""
        run, name = self.run, self.step
        if run.outcome.stop is not None:
            yield Verdict(passed=False, text=f"Stopped in step {name}: {run.outcome.stop.text}")
        elif run.quality is not None:
            text = f"Step {name} is not good enough to identify the payload: {run.quality.trouble}"
            yield Verdict(passed=False, text=text)
        yield Next(words=self.resume)


def run(request: PayloadSessionRequest, context: Context) -> IdentifiedPayload | StoppedSession:
    """Lead through a session."""
    from rid_daq.operations.payload.guided_session import run_payload_session

    return run_payload_session(request, context)


OPERATION: Final = Operation(
    name="payload session",
    label="Payload session",
    request=PayloadSessionRequest,
    run=run,
    examples=(
        "payload session kr15 --payload gripper --known m=2.805+-0.005",
        "payload session cell.yaml --resume latest --json",
    ),
    opens_cell=True,
    moves=True,
    module="rid_daq.operations.payload.guided_session",
)
