"""`Certificate`: the contents of a payload's certificate."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.runs.manifest import Manifest
from identification.payload.verdict import PayloadResult
from rid_daq.report.sections.payload import EmptyFlange, payload_verdict
from rid_daq.report.sections.runs import CellSection
from rid_daq.report.sections.verdict import VerdictSection


@dataclass(frozen=True, eq=False)
class Certificate:
    """What a payload's certificate says.

    Attributes:
        folder: The session, or the run that holds the payload: its manifest.
        is_session: True if it is a guided session.
        payload: The payload with its checks.
        how: How it was found.
        findings: What a person should know of it.
        by: Who answers for it; None if nobody was named.
        identified_utc: When the payload was identified; None if that is not recorded.
        cell: The cell; None of recordings from elsewhere.
        simulated: True if any of the runs is of a simulated cell.
        devices: Robot and drives, with their serial numbers; None if none is recorded.
        runs: The step of each run (empty outside of sessions) and its manifest, in the order of
            the session.
        files: Run, name and SHA-256 of the files of the session and of the runs; each SHA-256 has
            been compared with the file's bytes.
        identified_with, written_with: Which program identified the payload, and which wrote the
            certificate.
        empty: How it is known that nothing hung on the flange without payload; None if it is not.
    """

    folder: Manifest
    is_session: bool
    payload: PayloadResult
    how: str
    findings: tuple[str, ...]
    by: str | None
    identified_utc: str | None
    cell: CellSection | None
    simulated: bool
    devices: tuple[tuple[str, str | None], ...]
    runs: tuple[tuple[str, Manifest], ...]
    files: tuple[tuple[str, str, str], ...]
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
