"""`propose_joint_states`: proposes an import map for a bag with joint states."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from acquisition.proposals.proposal import Proposal, map_name
from acquisition.recording.recording import Recording
from acquisition.sources.bags import convert_bag_to_table, with_message_names
from config.errors import ConfigError, DataQualityError
from config.refusals import PLACEHOLDER
from config.robot.robot import RobotDescription

_NO_EFFORTS: Final = "RID-BAG-TOPIC"
"""Code of the error that no import map can mend."""


def propose_joint_states(
    path: Path, reference: str, topics: Mapping[str, tuple[str, ...]], robot: RobotDescription
) -> Proposal:
    """Propose a map for joint states, whose messages name the joints and use SI units.

    The quantity in `effort` is `?`, because the messages do not state it. The recording is imported
    as if the efforts were torques. If no topic names all joints of the robot, each of `names` is
    `?`, and nothing is imported.

    Args:
        path: The bag.
        reference: Robot that moved, for the map.
        topics: Topics with joint states, and the joints in their messages.
        robot: The robot.

    Raises:
        ConfigError: The bag cannot be read, or its messages lack positions or efforts.
    """
    arm = [topic for topic, names in topics.items() if set(robot.joint_names) <= set(names)]
    topic = next(iter(arm or topics))
    states: dict[str, Any] = {"effort": PLACEHOLDER}
    if len(topics) > 1:
        states["topic"] = topic
    keys: dict[str, Any] = {"name": map_name(path), "robot": reference, "joint_states": states}
    reasons = (f"{topic} has joint states, which name their joints and have SI units",)
    doubts: tuple[str, ...] = ()
    if len(arm) > 1:
        doubts = (f"topic: {topic} was chosen; other topics: {', '.join(arm[1:])}",)
    if not arm:
        states["names"] = [PLACEHOLDER] * len(robot.joints)
        doubt = (
            "names: replace each `?` by the joint's name in the messages, base to flange; they have"
            f" {', '.join(topics[topic])}"
        )
        return Proposal(keys, reasons, (doubt,), None)
    try:
        recording, report = _import_as_torques(path, keys, robot)
    except DataQualityError as error:
        if error.refusal == _NO_EFFORTS:
            raise ConfigError(str(error), code=_NO_EFFORTS) from None
        doubt = f"the import is refused: {error} [{error.refusal}]"
        return Proposal(keys, reasons, (*doubts, doubt), None)
    return Proposal(keys, reasons, doubts, report, recording)


def _import_as_torques(
    path: Path, keys: Mapping[str, Any], robot: RobotDescription
) -> tuple[Recording, ImportReport]:
    """Import a bag, with efforts that are torques."""
    states = keys["joint_states"] | {"effort": "torque"}
    import_map = ImportMap.model_validate({**keys, "joint_states": states}, strict=False)
    with TemporaryDirectory(prefix="rid-daq-") as folder:
        table = Path(folder) / path.name
        layout = convert_bag_to_table(path, import_map, robot.joint_names, table)
        return import_csv(table, with_message_names(layout, import_map), robot, layout=layout)
