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
    """Contents of a payload's certificate.

    Attributes:
        folder: Manifest of the session, or of the run that contains the payload.
        is_session: True if the payload was measured in a guided session.
        payload: The payload with its checks.
        how: Method by which the payload was estimated, in words.
        findings: Remarks that the reader of the certificate should know.
        by: Person who answers for the certificate; None if no person was named.
        identified_utc: Time at which the payload was identified; None if it is not recorded.
        cell: The cell; None for recordings that were imported.
        simulated: True if any of the runs is of a simulated cell.
        devices: Robot and drives, with their serial numbers; None if a number is not recorded.
        runs: Step and manifest of each run, in the order of the session. The step is empty outside
            a session.
        files: Run, name and SHA-256 of the files of the session and of the runs. Each SHA-256 has
            been compared with the file's bytes.
        identified_with, written_with: Program and version that identified the payload, and that
            wrote the certificate.
        empty: Evidence that the flange was empty in the runs without payload; None without any.
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
        """The verdict: passed if the payload is as accurate as required."""
        return payload_verdict(self.payload, self.empty)

    @property
    def is_whole(self) -> bool:
        """True if the motion makes all ten parameters identifiable."""
        return all(self.payload.estimate.is_determined)
