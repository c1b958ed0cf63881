"""`Certificate`: the contents of a payload's certificate."""

from __future__ import annotations

from dataclasses import dataclass

from identification.payload.verdict import PayloadResult
from rid_daq.report.sections.payload import EmptyFlange, payload_verdict
from rid_daq.report.sections.runs import CellSection
from rid_daq.report.sections.verdict import VerdictSection


@dataclass(frozen=True)
class CertifiedRun:
    """A run that a session recorded, or that a payload was identified from.

    Attributes:
        step: Which step of the session it was; empty outside of sessions.
        run_id, label, status: As its manifest says.
        created_utc, finished_utc: When it began and ended, ISO 8601.
    """

    step: str
    run_id: str
    label: str
    status: str
    created_utc: str
    finished_utc: str


@dataclass(frozen=True)
class CertifiedFile:
    """A file of a run, and the SHA-256 that was compared with its bytes."""

    run_id: str
    name: str
    sha256: str


@dataclass(frozen=True)
class Device:
    """A device of the cell, and its serial number; None where none is recorded."""

    name: str
    serial: str | None


@dataclass(frozen=True, eq=False)
class Certificate:
    """What a payload's certificate says.

    Attributes:
        run_id, label: The session, or the run that holds the payload.
        is_session: Whether it is a guided session.
        payload: The payload with its checks.
        how: How it was found.
        findings: What a person should know of it.
        by: Who answers for it; None where nobody was named.
        begun_utc, ended_utc: Of the session or run, ISO 8601.
        identified_utc: When the payload was identified; None where that is not recorded.
        cell: The cell; None of recordings from elsewhere.
        simulated: Whether any of the runs is of a simulated cell.
        devices: Robot and drives.
        runs: All runs, in the order of the session.
        files: Files of the session and of the runs.
        software: Name and version of what recorded.
        identified_with, written_with: Which program identified the payload, and which wrote the
            certificate.
        empty: How it is known that nothing hung on the flange without payload; None where it is
            not.
    """

    run_id: str
    label: str
    is_session: bool
    payload: PayloadResult
    how: str
    findings: tuple[str, ...]
    by: str | None
    begun_utc: str
    ended_utc: str
    identified_utc: str | None
    cell: CellSection | None
    simulated: bool
    devices: tuple[Device, ...]
    runs: tuple[CertifiedRun, ...]
    files: tuple[CertifiedFile, ...]
    software: tuple[tuple[str, str], ...]
    identified_with: str
    written_with: str
    empty: EmptyFlange | None = None

    @property
    def verdict(self) -> VerdictSection:
        """Whether the payload is as sure as was asked for."""
        return payload_verdict(self.payload, self.empty)

    @property
    def is_whole(self) -> bool:
        """Whether the motion shows all ten parameters."""
        return all(self.payload.estimate.seen)
