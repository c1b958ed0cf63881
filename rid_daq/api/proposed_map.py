"""`propose_map`: proposes the meaning of a file's columns; `ProposedMap`: the proposal to check."""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from acquisition.maps.import_joint import ImportJoint
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.proposal import Proposal
from config.errors import ConfigError, RidDaqError
from config.formats.whole_file import write_new
from config.formats.yaml_tree import parse_yaml
from config.load import validate
from rid_daq.api.arguments import ARGUMENT, as_path, plain
from rid_daq.api.robot import Robot, as_robot
from rid_daq.operations.experiment.map_proposal import propose_checked_map, to_map_text

_ROBOT_FILE: Final = "robot.yaml"


@dataclass(frozen=True, eq=False)
class ProposedMap:
    """A proposed import map: print it, check it, then give it to `read_recording`.

    Attributes:
        source: The file for which it was made.
        robot: The robot that moved.
        proposal: Keys, reasons and doubts.
    """

    source: Path
    robot: Robot
    proposal: Proposal

    @property
    def keys(self) -> Mapping[str, Any]:
        """Keys of the import map (docs/reference/files.md); `?` is a value that only you know."""
        return self.proposal.keys

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reason for each part of the map, one sentence each."""
        return self.proposal.reasons

    @property
    def doubts(self) -> tuple[str, ...]:
        """Assumptions that the file does not prove, one sentence each. Check them."""
        return self.proposal.doubts

    @property
    def missing(self) -> tuple[str, ...]:
        """Keys whose value only you know; give them to `with_values`."""
        return self.proposal.missing

    def with_values(self, **values: object) -> ProposedMap:
        """Return the map with other values, to complete or to correct it.

        Args:
            values: Keys of the import map. A key of the joints, such as torque_constant_nm_per_a,
                takes one value per joint, base to flange. A mapping, such as units={"torque":
                "mNm"}, changes only the keys that it contains.

        Raises:
            ConfigError: A key is unknown or the number of values differs from the number of joints
                (RID-API-ARGUMENT), or a value is invalid (RID-FILE-VALUE).
        """
        keys = copy.deepcopy(self.proposal.keys)
        for name, value in plain(values).items():
            if name in ImportJoint.model_fields:
                _set_in_joints(keys, name, value, self.robot)
            elif name in _states_fields(keys):
                keys["joint_states"][name] = value
            elif name not in ImportMap.model_fields:
                raise ConfigError(
                    f"{name}: unknown key of an import map; keys that are missing:"
                    f" {', '.join(self.missing) or 'none'}. docs/reference/files.md lists all keys",
                    code=ARGUMENT,
                )
            elif isinstance(value, Mapping) and isinstance(keys.get(name), dict):
                keys[name] |= value
            else:
                keys[name] = value
        changed = replace(self, proposal=replace(self.proposal, keys=keys))
        if not changed.missing:
            changed.to_import_map()
        return changed

    def to_import_map(self) -> ImportMap:
        """Return the complete import map.

        Raises:
            ConfigError: Values are missing (RID-FILE-PLACEHOLDER) or invalid (RID-FILE-VALUE).
        """
        if self.missing:
            raise ConfigError(
                f"the map proposed for {self.source.name} lacks {', '.join(self.missing)}, which"
                " only you know: print the proposal, and give the values with"
                f" proposal.with_values({self.missing[0]}=...)",
                code="RID-FILE-PLACEHOLDER",
            )
        text = to_map_text(self.source.name, self.proposal, _ROBOT_FILE)
        return validate(
            parse_yaml(text.encode(), f"map proposed for {self.source.name}"), ImportMap
        )

    def save(self, path: str | Path) -> None:
        """Write the map, with its reasons as comments, and the robot file next to it.

        The robot file has the name of the map with the ending .robot.yaml.

        Raises:
            ConfigError: A file exists (RID-FILE-EXISTS).
            RecordingError: A file cannot be written.
        """
        path = as_path("path", path)
        robot = path.with_name(f"{path.name.removesuffix('.yaml')}.robot.yaml")
        text = to_map_text(self.source.name, self.proposal, robot.name)
        write_new(robot, self.robot.to_text().encode())
        try:
            write_new(path, text.encode())
        except RidDaqError:
            robot.unlink()
            raise

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def __repr__(self) -> str:
        return str(self)

    def _lines(self) -> Iterator[str]:
        yield f"Proposed map for {self.source.name}, robot {self.robot.name}"
        yield from (f"{reason}." for reason in self.reasons)
        yield from (f"Check: {doubt}." for doubt in self.doubts)
        report = self.proposal.report
        for finding in () if report is None else report.findings:
            yield f"Finding of the import: {finding}."
        if self.missing:
            yield f"Missing, give with_values: {', '.join(self.missing)}."


def propose_map(source: str | Path, *, robot: Robot | str | Path) -> ProposedMap:
    """Propose the meaning of a file's columns, arrays or messages, with reasons.

    The file is imported on trial, to check the proposal. To use the data, give the result to
    `read_recording`.

    Args:
        source: A CSV, MAT, NPZ, HDF5 or Parquet file, or a ROS bag.
        robot: The robot that moved, its bundled name, or the path of a robot file.

    Raises:
        ConfigError: The file cannot be read, or its time stamps, positions or torques are not
            recognised (RID-IMPORT-PROPOSAL).
    """
    robot = as_robot("robot", robot)
    path = as_path("source", source)
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as place:
        file = Path(place) / _ROBOT_FILE
        robot.save(file)
        proposal = propose_checked_map(path, str(file))
    keys = proposal.keys | {"robot": robot.name}
    return ProposedMap(path, robot, replace(proposal, keys=keys))


def _states_fields(keys: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the keys of `joint_states` that are not keys of the joints, if the file is a bag."""
    return dict.fromkeys(("effort", "topic", "names")) if "joint_states" in keys else {}


def _set_in_joints(keys: MutableMapping[str, Any], name: str, values: object, robot: Robot) -> None:
    n = len(robot.joint_names)
    given = values if isinstance(values, Sequence) and not isinstance(values, str) else ()
    if len(given) != n:
        raise ConfigError(
            f"{name}: {len(given) or values!r}: give a list of {n} values, one per joint of"
            f" {robot.name}",
            code=ARGUMENT,
        )
    place = keys.get("joint_states", keys)
    joints = place.setdefault("joints", [{"joint": each} for each in robot.joint_names])
    for joint, value in zip(joints, given, strict=True):
        joint[name] = value
