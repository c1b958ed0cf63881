"""`propose_map`: proposes an import map for a recording, with the reasons for each key.

The columns of the joints are found by their names. Units that the names do not state are tried: the
proposal is the first map with which the recording can be imported, or the likeliest map if there is
none. For a file without names, the bundled maps are tried.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from acquisition.imports.findings import ContradictionError
from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from acquisition.maps.import_units import RATED
from acquisition.maps.torque_meaning import MOTOR_CURRENT
from acquisition.proposals.column_groups import (
    UNITS,
    ColumnGroup,
    find_groups,
    incomplete_groups,
)
from acquisition.proposals.joint_states import propose_joint_states
from acquisition.proposals.known_sources import KnownSource, recognise
from acquisition.proposals.proposal import Proposal, map_name
from acquisition.proposals.source_table import SourceTable, look_at
from acquisition.proposals.time_stamps import find_time, is_number
from acquisition.proposals.unit_guesses import (
    find_assumed_units,
    possible_units,
    unit_in_name,
    velocity_scale,
)
from acquisition.recording.recording import Recording
from acquisition.sources.array_tables import has_named_arrays, objects_in, write_array_tables
from acquisition.sources.bags import is_bag, joint_state_topics
from acquisition.sources.message_files import has_ros_messages
from config.errors import ConfigError, DataQualityError
from config.load import bundled_names, load_bundled_or_path, load_robot
from config.refusals import PLACEHOLDER
from config.robot.robot import RobotDescription

_WHOLE_VALUE: Final = re.compile(r"[-+]?\d+([.,]0*)?")
_FEWEST_RAW: Final = 20
_DISTURBANCE: Final = re.compile(r"disturb|dist[ ._]?(torq|trq)", re.IGNORECASE)
_COMPUTED: Final = re.compile(r"target_(moment|torque)|tau_d|desired_(torque|effort)")
_LOADS: Final = frozenset({"torque", "current"})


def propose_map(path: Path, robot_reference: str) -> Proposal:
    """Propose an import map for a CSV file, a file of arrays, or a bag with joint states.

    Args:
        path: The recording.
        robot_reference: Robot that moved: a bundled name or a robot file.

    Raises:
        ConfigError: The file has no table of numbers; or it has no time stamps, no positions of all
            joints, or neither torques nor currents of all joints that can be recognised; or a unit
            in its column names is not supported.
    """
    robot = load_robot(robot_reference)
    topics = joint_state_topics(path) if is_bag(path) and has_ros_messages(path) else {}
    if topics:
        return propose_joint_states(path, robot_reference, topics, robot)
    table = look_at(path)
    if not any(table.names):
        return _propose_bundled_map(path, table, robot_reference, robot)
    source = recognise(table.names)
    if source is not None and not _has_numbers(table, source.time):
        source = None
    groups, doubts = find_groups(table.names, robot.joint_names)
    if table.symbols and not (groups.keys() >= {"position"} and groups.keys() & _LOADS):
        table = replace(table, names=table.symbols)
        groups, doubts = find_groups(table.names, robot.joint_names)
    if source is not None and source.torques == MOTOR_CURRENT:
        groups.pop("torque", None)
    _require_groups(path, groups, table, robot, source)
    doubts += (*_raw_values(groups, table), *_same_names(groups, table))
    doubts += (*_disturbances(table.names), *_other_lengths(table, robot))
    reasons: list[str] = [] if source is None else [f"The columns are those of {source.title}"]
    time, time_units, why = find_time(path, table, source)
    reasons.append(why)
    for quantity, group in groups.items():
        first, last = table.names[group.columns[0]], table.names[group.columns[-1]]
        reasons.append(f"{quantity}: columns {first} to {last}")
    keys: dict[str, Any] = {
        "name": map_name(path),
        "robot": robot_reference,
        **table.keys,
    }
    joints, missing = _joints(table, groups, robot, source)
    keys |= {"time": time | {"unit": "s"}, "joints": joints}
    if source is not None and source.torques is not None:
        keys["torques"] = source.torques
        reasons.append(f"torques: {source.title} records them as {source.torques}")
    notes = (*doubts, *(() if source is None else source.notes), *missing)
    if missing:
        keys["time"]["unit"] = time_units[0]
        units = next(possible_units(groups, source))
        return Proposal(keys | {"units": units}, tuple(reasons), notes, None)
    return _first_possible_map(path, robot, keys, time_units, groups, source, reasons, notes)


def _raw_values(groups: Mapping[str, ColumnGroup], table: SourceTable) -> tuple[str, ...]:
    """Return a doubt if torques or currents without a unit are whole numbers."""
    doubts = []
    for quantity in ("torque", "current"):
        group = groups.get(quantity)
        if group is not None and not unit_in_name(group):
            texts = {row[column] for row in table.cells for column in group.columns}
            if len(texts) > _FEWEST_RAW and all(_WHOLE_VALUE.fullmatch(text) for text in texts):
                doubts.append(
                    f"{quantity}: all values are whole numbers, like the raw values of a drive."
                    f" If they are per mille of a rated value, give units.{quantity} permille and"
                    " the rated value (rated_torque_nm or rated_current_a)"
                )
    return tuple(doubts)


def _disturbances(names: Sequence[str]) -> tuple[str, ...]:
    """Return a doubt if columns are disturbance torques, as FANUC's data monitor records them."""
    found = [name for name in names if _DISTURBANCE.search(name)]
    if not found:
        return ()
    return (
        f"{found[0]}: disturbance torques are estimates of an observer, without the model's part,"
        " and are not used: record motor currents or motor torques. In a recording of FANUC's data"
        " monitor (which was not tried with a real file), J3 may be the angle to the ground: move"
        " J2 alone, and see if J3 changes",
    )


def _other_lengths(table: SourceTable, robot: RobotDescription) -> tuple[str, ...]:
    """Return a doubt for each quantity that the file also has with fewer samples."""
    groups, _ = find_groups(table.shorter, robot.joint_names)
    return tuple(
        f"{quantity}: {group.pattern} is not used, because it has fewer samples than the longest"
        " arrays: write a map to use it"
        for quantity, group in groups.items()
    )


def _other_columns(names: Sequence[str], robot: RobotDescription) -> str:
    """Return sentences about columns that could have been meant, for an error."""
    text = ""
    incomplete = incomplete_groups(names, robot.joint_names)
    if incomplete:
        text += f" The columns {', '.join(incomplete)} are not one per joint: name the right robot."
    computed = next((name for name in names if _COMPUTED.search(name)), None)
    if computed is not None:
        text += (
            f" {computed}: the controller computes this torque with its own model. A map with"
            " `torques: model_based` reads it, but `identify` then finds the controller's model."
        )
    return text


def _same_names(groups: Mapping[str, ColumnGroup], table: SourceTable) -> tuple[str, ...]:
    """Return a doubt for each used column whose name other columns have, too."""
    return tuple(
        f"{quantity}: {table.names.count(table.names[column])} columns are named"
        f" {table.names[column]}; the first one, column {column}, is used"
        for quantity, group in groups.items()
        for column in group.columns
        if table.names.count(table.names[column]) > 1
    )


def _require_groups(
    path: Path,
    groups: Mapping[str, ColumnGroup],
    table: SourceTable,
    robot: RobotDescription,
    source: KnownSource | None,
) -> None:
    lacking = [] if "position" in groups else ["positions"]
    if "torque" not in groups and "current" not in groups:
        lacking.append("torques or currents")
    if lacking:
        names = ", ".join(name or "(no name)" for name in table.names[:20])
        known = "" if source is None else f" {source.title}: {'; '.join(source.notes)}."
        known += "".join(f" {words}." for words in _disturbances(table.names))
        known += _other_columns(table.names, robot)
        motors = [name for name in table.names if "motor" in name.lower()]
        if "position" not in groups and motors:
            known += f" {motors[0]}: positions of motors need a map with `side: motor`."
        raise ConfigError(
            f"{path}: no import map can be proposed, because the columns with the"
            f" {' and the '.join(lacking)} of {robot.name}'s {len(robot.joints)} joints were not"
            f" recognised; columns: {names}{', …' if len(table.names) > 20 else ''}"
            f"{objects_in(path)}.{known} Write a"
            " map (`rid-daq docs someone-elses-recording`)",
            code="RID-IMPORT-PROPOSAL",
        )
    for group in groups.values():
        unreadable = "\ufffd" in group.unit  # the file is not in UTF-8
        if f"[{group.unit}]" in group.pattern and not (unreadable or unit_in_name(group)):
            raise ConfigError(
                f"{path}: no import map can be proposed, because the unit [{group.unit}] of the"
                f" columns {group.pattern} is not one of {', '.join(UNITS[group.quantity])}:"
                " convert the columns",
                code="RID-IMPORT-PROPOSAL",
            )


def _has_numbers(table: SourceTable, name: str) -> bool:
    """Return True if the cells of a column are numbers, with a decimal point or comma."""
    column = table.names.index(name)
    return all(is_number(row[column]) for row in table.cells if row[column])


def _joints(
    table: SourceTable,
    groups: Mapping[str, ColumnGroup],
    robot: RobotDescription,
    source: KnownSource | None,
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the entries of the joints, and what a person must add."""
    used = {name: group for name, group in groups.items() if name != "current"}
    if "torque" not in groups:
        used["current"] = groups["current"]
    stated = {name: unit_in_name(group) for name, group in used.items()}
    stated |= {} if source is None else dict(source.units)
    unknown = {
        "rated_current_a": ("current", RATED, "the current that is 100 percent"),
        "rated_torque_nm": ("torque", RATED, "the torque that is 100 percent"),
        "increments_per_rev": ("position", ("increments",), "the encoder increments per turn"),
    }
    needed = {
        key: f"{key}: replace `?` by {words}"
        for key, (quantity, units, words) in unknown.items()
        if quantity in used and stated.get(quantity) in units
    }
    needs_constant = "current" in used
    joints: list[dict[str, Any]] = []
    without: list[str] = []
    for number, joint in enumerate(robot.joints):
        entry: dict[str, Any] = {"joint": joint.name}
        for quantity, group in used.items():
            column = group.columns[number]
            name = table.names[column]
            unique = table.by_name and table.names.count(name) == 1
            entry[quantity] = name if unique else column
        entry |= dict.fromkeys(needed, PLACEHOLDER)
        if needs_constant and joint.torque_constant_nm_per_a is None:
            entry["torque_constant_nm_per_a"] = PLACEHOLDER
            without.append(joint.name)
        joints.append(entry)
    missing = []
    if without:
        missing.append(
            f"torque_constant_nm_per_a of {', '.join(without)}: neither the file nor the robot file"
            " states it; replace `?` by the torque per ampere at the link"
        )
    return joints, (*missing, *needed.values())


def _first_possible_map(
    path: Path,
    robot: RobotDescription,
    keys: dict[str, Any],
    time_units: Sequence[str],
    groups: Mapping[str, ColumnGroup],
    source: KnownSource | None,
    reasons: Sequence[str],
    doubts: tuple[str, ...],
) -> Proposal:
    """Return the first possible map with which the recording can be imported, or the likeliest."""
    tried: list[str] = []
    first: Proposal | None = None
    contradicted: set[tuple[str, float | None]] = set()
    for unit, units in itertools.product(time_units, possible_units(groups, source)):
        scale = velocity_scale(units)
        if scale is not None and (unit, scale) in contradicted:
            continue  # a smaller unit may only hide the contradiction in joints at rest
        tested = keys | {"time": keys["time"] | {"unit": unit}, "units": units}
        words = f"time in {unit}, {', '.join(f'{name} in {each}' for name, each in units.items())}"
        try:
            recording, report = try_import(path, tested, robot)
        except DataQualityError as error:
            if isinstance(error, ContradictionError):
                contradicted.add((unit, scale))
            tried.append(f"{words}: refused ({error.refusal})")
            first = first or Proposal(
                tested,
                tuple(reasons),
                (*doubts, f"the import is refused: {error} [{error.refusal}]"),
                None,
            )
            continue
        assumed = [
            f"{name}: the file does not state its unit, {each} is assumed"
            for name, each in find_assumed_units(units, groups, source).items()
        ]
        doubts = (*doubts, *assumed)
        because = f"With these units the recording can be imported: {words}{_agreement(report)}"
        other = () if not tried else (f"Other units were tried: {'; '.join(tried)}",)
        return Proposal(tested, (*reasons, because, *other), doubts, report, recording)
    assert first is not None
    return first


def _agreement(report: ImportReport) -> str:
    ratios = [ratio for ratio in report.velocity_ratio if ratio is not None]
    if not ratios:
        return "; no recorded velocities confirm them"
    return f"; velocities agree with positions within {100 * max(abs(r - 1) for r in ratios):.1f} %"


def try_import(
    path: Path, keys: Mapping[str, Any], robot: RobotDescription
) -> tuple[Recording, ImportReport]:
    """Import a recording with the keys of a map.

    Raises:
        ConfigError, DataQualityError: As for `import_csv`.
    """
    import_map = ImportMap.model_validate(keys, strict=False)
    if not has_named_arrays(path):
        return import_csv(path, import_map, robot)
    with TemporaryDirectory(prefix="rid-daq-") as folder:
        (file,), layout = write_array_tables((path,), import_map, Path(folder))
        return import_csv(file, import_map, robot, layout=layout)


def _propose_bundled_map(
    path: Path, table: SourceTable, reference: str, robot: RobotDescription
) -> Proposal:
    """Return the first bundled map that fits a file without a header.

    It has as many columns as the file and as many joints as the robot, and can import the file.
    """
    width, own = len(table.names), robot.joint_names
    for name in bundled_names("maps"):
        import_map = load_bundled_or_path(name, "maps", ImportMap)
        if import_map.columns != width or len(import_map.joints) != len(own):
            continue
        keys = import_map.model_dump(mode="json", exclude_unset=True) | {"robot": reference}
        doubts: tuple[str, ...] = ()
        if import_map.joint_names != own:
            for joint, other in zip(keys["joints"], own, strict=True):
                joint["joint"] = other
            doubts = (
                f"joints: map {name} is for robot {import_map.robot}. Assumed: its joints are, in"
                f" this order, {', '.join(own)} of your robot, with the map's torque constants",
            )
        try:
            recording, report = try_import(path, keys, robot)
        except DataQualityError:
            continue
        reasons = (
            f"The file has no header and {width} columns, as the bundled map {name} describes",
            f"The recording can be imported with it{_agreement(report)}",
        )
        return Proposal(keys, reasons, doubts, report, recording)
    raise ConfigError(
        f"{path}: no import map can be proposed, because its {width} columns have no names, and no"
        f" bundled map for {len(own)} joints with so many columns fits {robot.name}. Write a map"
        " (`rid-daq docs someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )
