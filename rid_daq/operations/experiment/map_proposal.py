"""`write_proposal`: writes a proposed import map, and shows the reasons for it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.maps.torque_meaning import MEANINGS, MOTOR_CURRENT, TorqueMeaning
from acquisition.proposals.proposal import Proposal
from acquisition.proposals.propose import propose_map
from config.errors import ConfigError
from config.formats.whole_file import write_new
from config.formats.yaml_tree import dump_yaml
from config.load import bundled_names, load_robot
from config.refusals import PLACEHOLDER
from identification.wiring.torque_origin import judge_torques
from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.experiment.import_ import ImportRequest
from rid_daq.operations.experiment.judged_efforts import judge_efforts


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

    def document(self) -> Mapping[str, object]:
        """Return the map, the reasons and the doubts."""
        return {
            "map": str(self.path),
            "keys": self.proposal.keys,
            "reasons": list(self.proposal.reasons),
            "doubts": list(self.proposal.doubts),
            "can_be_imported": self.proposal.report is not None and not self.proposal.missing,
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
        ConfigError: The file has no columns that can be recognised, several files are given, the
            map's file exists, or an option is missing or has no effect.
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
    robot = request.robot
    proposal = propose_checked_map(recording, robot)
    if robot not in bundled_names("robots"):
        robot = os.path.relpath(robot, path.absolute().parent)
    write_new(path, to_map_text(recording.name, proposal, robot).encode())
    return MapProposal(path, recording, proposal)


def propose_checked_map(path: Path, robot_reference: str) -> Proposal:
    """Propose an import map, and judge the meaning of the torques from the data.

    The meaning is proposed if the recording's program or its columns define it, or if the data show
    only one. Otherwise it is `?`. The same holds for the quantity in the efforts of joint states.

    Args:
        path: The recording.
        robot_reference: Robot that moved: a bundled name or a robot file.

    Raises:
        ConfigError: As for `propose_map`.
    """
    proposal = propose_map(path, robot_reference)
    if "torques" in proposal.keys:
        return proposal
    if "joint_states" in proposal.keys:
        return judge_efforts(proposal, load_robot(robot_reference))
    currents = any("current" in joint for joint in proposal.keys.get("joints", ()))
    judged = None
    meanings: tuple[TorqueMeaning, ...] = (MOTOR_CURRENT,) if currents else ()
    why = "the columns are currents" if currents else "neither the file nor the data show it"
    if proposal.recording is not None:
        robot = load_robot(robot_reference)
        judged = judge_torques(proposal.recording, robot, currents=currents)
    if judged is not None:
        meanings, why = judged.meanings, judged.reason
    if len(meanings) == 1:
        value: str = meanings[0]
        doubt = f"torques: {value} ({MEANINGS[meanings[0]]}) is assumed, because {why}"
    else:
        value = PLACEHOLDER
        choice = "; ".join(f"{name}: {MEANINGS[name]}" for name in meanings or MEANINGS)
        doubt = f"torques: replace `?` by the meaning of the torques, because {why} ({choice})"
    keys = proposal.keys | {"torques": value}
    return replace(proposal, keys=keys, doubts=(*proposal.doubts, doubt))


def to_map_text(name: str, proposal: Proposal, robot: str) -> str:
    """Return a proposed map as YAML; comments give the reasons and what must be checked.

    Args:
        name: Name of the recording's file.
        proposal: The proposal.
        robot: Bundled name, or the path of the robot file relative to the map.
    """
    comment = "\n".join(
        (
            f"Import map proposed for {name}: check it before use.",
            *proposal.reasons,
            *(f"Check: {doubt}" for doubt in proposal.doubts),
        )
    )
    return dump_yaml(proposal.keys | {"robot": robot}, comment)
