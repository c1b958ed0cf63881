"""`SessionState`: what of a guided payload session is done already."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Final, Literal

from pydantic import Field, JsonValue, ValidationError

from acquisition.runs.catalogue import find_run_inside
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from config.formats.json_file import parse_json
from config.model import ConfigModel
from rid_daq.operations.payload.payload_session import LOADED, UNLOADED
from rid_daq.report.sections.payload import EmptyFlange
from rid_daq.runs.run_data import SESSION, RunData

STATE: Final = SESSION
EMPTY_FLANGE: Final = "empty_flange"
SCHEMA: Final = "rid-daq payload session 1"


class _State(ConfigModel):
    """What stands in the file of a session's state."""

    format: Literal["rid-daq payload session 1"] = Field(alias="schema")
    cell: str
    done: dict[str, str]
    facts: dict[str, object]
    asked: dict[str, object] = Field(default_factory=dict)


@dataclass
class SessionState:
    """Which steps of a session are done: step to run id; written after every step.

    Attributes:
        folder: The session's own folder.
        cell: Name of the cell.
        done: Step to id of its run, in the order of recording.
        facts: What was measured on the way: drift, skipped steps.
        asked: What was asked for when it was begun and is not the usual.
    """

    folder: RunFolder
    cell: str
    done: dict[str, str] = field(default_factory=dict)
    facts: dict[str, object] = field(default_factory=dict)
    asked: dict[str, object] = field(default_factory=dict)

    @property
    def measurements(self) -> tuple[str, ...]:
        """The steps that are done and that the payload is estimated from."""
        return tuple(name for name in self.done if is_measurement(name))

    @property
    def empty_flange(self) -> EmptyFlange | None:
        """How it is known that nothing was on the flange without payload; None where it is not."""
        told = self.facts.get(EMPTY_FLANGE)
        return EmptyFlange(told) if isinstance(told, str) and told in set(EmptyFlange) else None

    def runs(self) -> list[RunData]:
        """Return the runs of those steps.

        Raises:
            RidDaqError: One of them cannot be used.
        """
        root = self.folder.path.parent
        return [RunData.load(find_run_inside(root, self.done[name])) for name in self.measurements]

    def note_step(self, name: str, run_id: str) -> None:
        """Keep that a step is done, and by which run."""
        self.done[name] = run_id
        self.write()

    def note_fact(self, name: str, fact: JsonValue) -> None:
        """Keep a fact of the session."""
        self.facts[name] = fact
        self.write()

    def write(self) -> None:
        """Write the state into the session's folder.

        Raises:
            RecordingError: It cannot be written.
        """
        document = {
            "schema": SCHEMA,
            "cell": self.cell,
            "done": self.done,
            "facts": self.facts,
            "asked": self.asked,
        }
        self.folder.write(STATE, (json.dumps(document, indent=1) + "\n").encode())

    @classmethod
    def read(cls, folder: RunFolder) -> SessionState:
        """Read the state of an interrupted session.

        Raises:
            ConfigError: The folder is not of a payload session.
        """
        if not folder.file(STATE).exists():
            raise ConfigError(
                f"{folder.path}: is not the folder of a payload session", code="RID-SESSION-STATE"
            )
        try:
            document = _State.model_validate(parse_json(folder.read(STATE)))
        except (ConfigError, ValidationError) as error:
            first = error.errors()[0] if isinstance(error, ValidationError) else None
            said = f"{'.'.join(map(str, first['loc']))}: {first['msg']}" if first else str(error)
            raise ConfigError(
                f"{folder.file(STATE)}: not the state of a payload session ({said}); was it"
                " edited?",
                code="RID-SESSION-STATE",
            ) from None
        return cls(folder, document.cell, document.done, document.facts, document.asked)


def is_measurement(step: str) -> bool:
    """Return whether the payload is estimated from a step."""
    return step.startswith((UNLOADED, LOADED))
