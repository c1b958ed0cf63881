"""A request field and a result that several operations on payloads share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NotRequired, TypedDict

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Text, note_blocks
from rid_daq.blocks.block import Verdict as VerdictBlock
from rid_daq.requests.option import Option

if TYPE_CHECKING:
    from rid_daq.operations.payload.session_states import SessionFile
    from rid_daq.report.sections.payload import PayloadSection
    from rid_daq.report.sections.verdict import VerdictSection

PayloadFile = Annotated[
    Path,
    Field(
        description="Payload file; or a session or run with a payload: a folder, an id, a label"
        " or `latest`."
    ),
    Option(positional=True, metavar="PAYLOAD", file="input"),
]


class IdentifiedPayloadDocument(TypedDict):
    """An identified payload; of a session also its run and its steps."""

    file: str
    payload: object
    verdict: object
    report: str
    notes: NotRequired[list[str]]
    session: NotRequired[str]
    done: NotRequired[dict[str, str]]
    facts: NotRequired[object]


@dataclass(frozen=True)
class IdentifiedPayload:
    """A payload that was identified, and its files.

    Attributes:
        section: The payload.
        verdict: Verdict on the limits of its intervals.
        file: Path of the payload file.
        report: Path of the report.
        fits: True if no check failed that compares the model with the torques.
        notes: Defects of the runs' data.
        session: File of the guided session; None without a session.
    """

    section: PayloadSection
    verdict: VerdictSection
    file: Path
    report: Path
    fits: bool
    notes: tuple[str, ...] = ()
    session: SessionFile | None = None

    @property
    def exit_code(self) -> int:
        """Exit code 6 if an axis torque is not explained, 1 if the verdict fails otherwise."""
        from rid_daq.terminal.exit_codes import ExitCode

        if self.verdict.passed:
            return ExitCode.DONE
        return ExitCode.VERDICT_FAILED if self.fits else ExitCode.DATA_QUALITY

    def document(self) -> IdentifiedPayloadDocument:
        """Return payload, verdict and files; for a session also its completed steps."""
        found: IdentifiedPayloadDocument = {
            "file": str(self.file),
            "payload": self.section,
            "verdict": self.verdict,
            "report": str(self.report),
        }
        if self.session is None:
            return {**found, "notes": list(self.notes)}
        done, facts = self.session.done, self.session.facts
        return {**found, "session": self.session.folder.run_id, "done": done, "facts": facts}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the payload, the verdict, the files and the next commands."""
        from rid_daq.report.section_blocks.payload import payload_blocks

        yield from note_blocks(self.notes)
        yield from payload_blocks(self.section)
        yield VerdictBlock(passed=self.verdict.passed, text=self.verdict.headline)
        yield Text(text=self.verdict.sentence)
        yield Text(text=f"Payload: {self.file}")
        yield Text(text=f"Report: {self.report}", is_for_terminal=True)
        if self.verdict.passed:
            yield Next(words=("payload", "export", str(self.file), "--to", "FORMAT", "-o", "FILE"))
        if self.verdict.passed and self.session is not None:
            session = str(self.session.folder.path)
            yield Next(words=("payload", "certificate", session, "--by", "NAME"))
