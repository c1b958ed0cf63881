"""`PayloadSteps`: the motions of a guided payload session, and what of them is done already."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import typer
from pydantic import Field, JsonValue, ValidationError

from acquisition.motion.plan import plan_motion
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.record import RecordOutcome, record_motion
from config.cell.cell import CellConfig
from config.errors import ConfigError, PreflightError
from config.formats.json_file import parse_json
from config.load import LoadedCell, to_yaml
from config.model import ConfigModel
from config.motion.motion import FourierMotion
from rid_daq.jobs.payload_watch import Watch
from rid_daq.jobs.recording_job import ended_words, how_it_ended, progress_shown, tell_notes
from rid_daq.live.live_page import LivePage
from rid_daq.runs.flange import note_flange
from rid_daq.session.session import unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import asked
from rid_daq.terminal.console import Console

if TYPE_CHECKING:
    from mock_hw.cell import SimulatedCell

STATE: Final = "session.json"
SCHEMA: Final = "rid-daq payload session 1"


class _State(ConfigModel):
    """What stands in the file of a session's state."""

    format: Literal["rid-daq payload session 1"] = Field(alias="schema")
    cell: str
    done: dict[str, str]
    facts: dict[str, Any]


@dataclass
class SessionState:
    """Which steps of a session are done: step to run id; written after every step.

    Attributes
    ----------
    folder : RunFolder
        The session's own folder.
    cell : str
        Name of the cell.
    done : dict
        Step to id of its run, in the order of recording.
    facts : dict
        What was measured on the way: drift, skipped steps.
    """

    folder: RunFolder
    cell: str
    done: dict[str, str] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    def write(self) -> None:
        """Write the state into the session's folder.

        Raises
        ------
        RecordingError
            It cannot be written.
        """
        document = {
            "schema": SCHEMA,
            "cell": self.cell,
            "done": self.done,
            "facts": self.facts,
        }
        self.folder.write(STATE, (json.dumps(document, indent=1) + "\n").encode())

    @classmethod
    def read(cls, folder: RunFolder) -> SessionState:
        """Read the state of an interrupted session.

        Raises
        ------
        ConfigError
            The folder is not of a payload session.
        """
        if not folder.file(STATE).exists():
            raise ConfigError(f"{folder.path}: is not the folder of a payload session")
        try:
            document = _State.model_validate(parse_json(folder.read(STATE)))
        except (ConfigError, ValidationError) as error:
            first = error.errors()[0] if isinstance(error, ValidationError) else None
            said = f"{'.'.join(map(str, first['loc']))}: {first['msg']}" if first else str(error)
            raise ConfigError(
                f"{folder.file(STATE)}: not the state of a payload session ({said}); was it edited?"
            ) from None
        return cls(folder, document.cell, document.done, document.facts)


@dataclass(frozen=True)
class PayloadSteps:
    """Records the motions of a session, one after the other, on one cell.

    Attributes
    ----------
    loaded : LoadedCell
        The cell and its files.
    cell : CellConfig
        The cell as it is reachable.
    console : Console
        Where progress is shown.
    simulated : SimulatedCell or None
        The mock hardware, where it was started here.
    page : LivePage, optional
        Where it is shown too.
    """

    loaded: LoadedCell
    cell: CellConfig
    console: Console
    simulated: SimulatedCell | None = None
    page: LivePage | None = None

    def record(
        self, motion: FourierMotion, folder: RunFolder, role: str, watch: Watch | None = None
    ) -> RecordOutcome:
        """Record a motion into a run folder and close it; the watch may end it early.

        Raises
        ------
        PreflightError, DriverError, RecordingError
            Nothing was moved, or nothing was recorded.
        """
        samples = plan_motion(motion, self.loaded.robot, self.cell.cycle_time_s)
        for name, content in self.loaded.files.items():
            folder.write(name, content)
        folder.write("motion.yaml", to_yaml(motion, f"Of a payload session: {role}.").encode())
        facts: dict[str, JsonValue] = {"robot": self.loaded.robot.name}
        if self.simulated is not None:
            facts |= note_flange(folder, self.loaded, self.simulated.attached)
        periods = len(samples) / (samples.samples_per_period or len(samples))
        onlooker = None
        if self.page is not None:
            title = f"Payload session: {role}"
            onlooker = self.page.onlooker(title, samples, self.cell, self.loaded.robot)
        with unfinished(folder), self.console.progress(role, periods, "periods") as display:
            show = progress_shown(samples, self._shown(display.update, watch))
            outcome = record_motion(
                self.cell,
                self.loaded.robot,
                samples,
                folder,
                on_progress=show,
                enough=None if watch is None else watch.enough,
                drive_profile=self.loaded.drive_profile,
                onlooker=onlooker,
            )
        status = RunStatus.COMPLETE if outcome.complete else RunStatus.STOPPED
        tell_notes(self.console, outcome)
        with how_it_ended(ended_words(outcome, role)):
            folder.finish(status, facts | {"rows": outcome.rows})
        return outcome

    def _shown(
        self, show: Callable[[float, str], None], watch: Watch | None
    ) -> Callable[[float, str], None]:
        def shown(done: float, line: str) -> None:
            said = "" if watch is None else watch.line()
            show(done, f"{line}; {said}" if said else line)

        return shown


def rehearsal_of(motion: FourierMotion, speed: float, cycle_s: float) -> FourierMotion:
    """Return one period of the same path at a share of its speed, or a little less."""
    cycles = math.ceil(motion.period_s / speed / cycle_s - 1e-9)
    return motion.model_copy(
        update={"period_s": cycles * cycle_s, "periods": 1, "transient_periods": 0}
    )


def new_run(root: RunFolder, label: str, role: str) -> RunFolder:
    """Return a new run folder beside a session's own."""
    text = f"{label} {role}"[:64]
    return RunFolder.create(root.path.parent, text, software=software_versions())


def require_yes(console: Console, question: str, answered: bool) -> None:
    """Ask a person, unless a flag answers.

    Raises
    ------
    PreflightError
        Nobody can be asked, or the answer is no.
    """
    if answered:
        console.say(question)
        console.say("  answered by flag")
        return
    if not sys.stdin.isatty():
        raise PreflightError(f"{question} Nobody can be asked here: answer by the flags (--yes)")
    if not asked(typer.confirm, f"{question} Done?"):
        raise PreflightError("nothing was moved further: the answer was no")
