"""`write_proposal`: writes a proposed import map, and shows the reasons for it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from acquisition.proposals.propose import Proposal, propose_map
from config.errors import ConfigError
from config.formats.whole_file import write_new
from config.formats.yaml_tree import dump_yaml
from config.load import bundled_names
from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.experiment.import_ import ImportRequest


@dataclass(frozen=True)
class MapProposal:
    """A proposed import map that was written to a file.

    Attributes:
        path: The map.
        recording: File for which it was made.
        proposal: Keys, reasons and doubts.
    """

    path: Path
    recording: Path
    proposal: Proposal
    exit_code: int = 0

    def document(self) -> Mapping[str, object]:
        """Return the map, the reasons and the doubts."""
        return {
            "map": str(self.path),
            "keys": self.proposal.keys,
            "reasons": list(self.proposal.reasons),
            "doubts": list(self.proposal.doubts),
            "can_be_imported": self.proposal.report is not None,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield reasons, what must be checked, and the next command."""
        for reason in self.proposal.reasons:
            yield Text(text=f"{reason}.")
        for doubt in self.proposal.doubts:
            yield Text(text=f"Check: {doubt}.")
        findings = () if self.proposal.report is None else self.proposal.report.findings
        for finding in findings:
            yield Text(text=f"Finding of the import: {finding}.")
        yield Verdict(passed=None, text=f"Proposed map: {self.path}")
        yield Next(
            lead="After you have checked the map",
            words=("import", str(self.recording), "--map", str(self.path)),
        )


def write_proposal(request: ImportRequest) -> MapProposal:
    """Propose an import map for a recording and write it.

    Raises:
        ConfigError: The file has no columns that can be recognised, several files are given, or the
            map's file exists.
        RecordingError: The map cannot be written.
    """
    if request.robot is None:
        raise ConfigError(
            "give --map MAP, or --robot ROBOT for a proposed map", code="RID-OPTION-NEEDS"
        )
    if request.rows or request.label:
        raise ConfigError(
            "--rows and --label have no effect without --map: leave them out until the map exists",
            code="RID-OPTION-NO-EFFECT",
        )
    recording, *further = request.file
    if further:
        raise ConfigError(
            f"{further[0]}: a map is proposed for one file only: leave this file out, or write the"
            " map yourself",
            code="RID-IMPORT-FILES",
        )
    path = request.proposal or Path(f"{recording.stem}.map.yaml")
    proposal = propose_map(recording, request.robot)
    robot = request.robot
    if robot not in bundled_names("robots"):
        robot = os.path.relpath(robot, path.absolute().parent)
    comment = "\n".join(
        (
            f"Import map proposed for {recording.name}: check it before use.",
            *proposal.reasons,
            *(f"Check: {doubt}" for doubt in proposal.doubts),
        )
    )
    write_new(path, dump_yaml(proposal.keys | {"robot": robot}, comment).encode())
    return MapProposal(path, recording, proposal)
