"""`propose_map`: proposes an import map for a recording, with the reasons for each key.

The columns of the joints are found by their names. Units that the names do not state are tried: the
proposal is the first map with which the recording can be imported.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from acquisition.imports.import_map import ImportMap, ImportUnits
from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.imports.time_column import match_iso
from acquisition.proposals.column_groups import ColumnGroup, find_groups
from acquisition.proposals.known_sources import KnownSource, recognise
from acquisition.proposals.source_table import SourceTable, look_at
from acquisition.sources.array_tables import has_named_arrays, write_array_tables
from acquisition.sources.bags import is_bag, joint_state_topics
from acquisition.sources.message_files import has_ros_messages
from config.errors import ConfigError, DataQualityError
from config.load import bundled_names, load_bundled_or_path, load_robot
from config.refusals import PLACEHOLDER
from config.robot.robot import RobotDescription

_TIME_NAME: Final = re.compile(
    r"(__)?(time|t|timestamp|stamp|zeit|zeitstempel|ipoc|secs?|log_time)([^a-z].*)?", re.IGNORECASE
)
_STEPS_S: Final = (2e-4, 0.2)
_UNITS: Final = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
_WHOLE: Final = re.compile(r"[-+]?\d+")


@dataclass(frozen=True)
class Proposal:
    """A proposed import map.

    Attributes:
        keys: Contents of the map; a value that a person must state is `?`.
        reasons: Reason for each part, one sentence each.
        doubts: What could not be decided from the file, one sentence each.
        report: Import with this map; None if it was not possible.
    """

    keys: dict[str, Any]
    reasons: tuple[str, ...]
    doubts: tuple[str, ...]
    report: ImportReport | None


def propose_map(path: Path, robot_reference: str) -> Proposal:
    """Propose an import map for a CSV file or a file of arrays.

    Args:
        path: The recording.
        robot_reference: Robot that moved: a bundled name or a robot file.

    Raises:
        ConfigError: The file has no table of numbers, or no time stamps, or no positions, torques
            or currents of all joints can be found in it.
    """
    robot = load_robot(robot_reference)
    topics = joint_state_topics(path) if is_bag(path) and has_ros_messages(path) else {}
    if topics:
        return _propose_joint_states(path, robot_reference, topics, robot)
    table = look_at(path)
    if not any(table.names):
        return _propose_bundled_map(path, table, robot)
    source = recognise(table.names)
    groups, doubts = find_groups(table.names, robot.joint_names)
    _require_groups(path, groups, table, robot)
    reasons: list[str] = [] if source is None else [f"The columns are those of {source.title}"]
    time, time_units, why = _time(path, table, source)
    reasons.append(why)
    for quantity, group in groups.items():
        first, last = table.names[group.columns[0]], table.names[group.columns[-1]]
        reasons.append(f"{quantity}: columns {first} to {last}")
    keys: dict[str, Any] = {
        "name": _map_name(path),
        "robot": robot_reference,
        **table.keys,
    }
    joints, missing = _joints(table, groups, robot, source)
    keys |= {"time": {"column": time, "unit": "s"}, "joints": joints}
    notes = (*doubts, *(() if source is None else source.notes), *missing)
    if missing:
        keys["time"]["unit"] = time_units[0]
        units = next(_units(groups, source))
        return Proposal(keys | {"units": units}, tuple(reasons), notes, None)
    return _first_that_works(path, robot, keys, time_units, groups, source, reasons, notes)


def _propose_joint_states(
    path: Path, reference: str, topics: Mapping[str, tuple[str, ...]], robot: RobotDescription
) -> Proposal:
    """Propose a map for joint states, whose messages name the joints and use SI units."""
    arm = [topic for topic, names in topics.items() if set(robot.joint_names) <= set(names)]
    topic = next(iter(arm or topics))
    states: dict[str, Any] = {"effort": PLACEHOLDER}
    if len(topics) > 1:
        states["topic"] = topic
    doubts = ["effort: replace `?` by torque or current; the messages do not state it"]
    if not arm:
        states["names"] = [PLACEHOLDER] * len(robot.joints)
        doubts.append(
            "names: replace each `?` by the joint's name in the messages, base to flange; they have"
            f" {', '.join(topics[topic])}"
        )
    reasons = (f"{topic} has joint states, which name their joints and have SI units",)
    keys = {"name": _map_name(path), "robot": reference, "joint_states": states}
    return Proposal(keys, reasons, tuple(doubts), None)


def _map_name(path: Path) -> str:
    return re.sub(r"[^\w.-]+", "_", path.stem, flags=re.ASCII)[:64].lstrip("_.-") or "recording"


def _require_groups(
    path: Path, groups: Mapping[str, ColumnGroup], table: SourceTable, robot: RobotDescription
) -> None:
    lacking = [] if "position" in groups else ["positions"]
    if "torque" not in groups and "current" not in groups:
        lacking.append("torques or currents")
    if lacking:
        names = ", ".join(name or "(no name)" for name in table.names[:20])
        raise ConfigError(
            f"{path}: no import map can be proposed, because the columns with the"
            f" {' and the '.join(lacking)} of {robot.name}'s {len(robot.joints)} joints were not"
            f" recognised; columns: {names}{', …' if len(table.names) > 20 else ''}. Write a map"
            " (`rid-daq docs someone-elses-recording`)",
            code="RID-IMPORT-PROPOSAL",
        )


def _time(
    path: Path, table: SourceTable, source: KnownSource | None
) -> tuple[str | int, tuple[str, ...], str]:
    """Return the column of the time stamps, its possible units, the likeliest first, and why."""
    candidates = [
        n
        for n, name in enumerate(table.names)
        if _TIME_NAME.fullmatch(re.split(r"[./]", name.strip())[-1])
    ]
    if source is not None:
        candidates = [_common_time(path, table, source)]
    for number in candidates:
        name = table.names[number]
        column: str | int = name if table.by_name and table.names.count(name) == 1 else number
        texts = [row[number] for row in table.cells if row[number]]
        if source is not None:
            return column, (source.time_unit,), f"time: column {name}, unit {source.time_unit}"
        if all(match_iso(text) for text in texts):
            return column, ("iso",), f"time: column {name} has dates with a time of day"
        try:
            stamps = np.array([float(text.replace(",", ".")) for text in texts])
        except ValueError:
            continue
        steps = np.diff(stamps)
        step = float(np.median(steps)) if len(steps) else 0.0
        if step <= 0.0 or np.mean(steps > 0.0) < 0.5:
            continue
        units = tuple(unit for unit, s in _UNITS if _STEPS_S[0] <= step * s <= _STEPS_S[1])
        if "ns" in units and not all(_WHOLE.fullmatch(text) for text in texts):
            units = tuple(unit for unit in units if unit != "ns")
        if units:
            return column, units, f"time: column {name} increases by {step:.6g} from row to row"
    raise ConfigError(
        f"{path}: no import map can be proposed, because no column of time stamps was recognised."
        " Write a map with `time`, or with rate_hz (`rid-daq docs someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )


def _common_time(path: Path, table: SourceTable, source: KnownSource) -> int:
    """Return the first column of time stamps of a known program.

    Raises:
        ConfigError: The columns of time stamps differ, so that a row has values of several times.
    """
    first, *others = (n for n, name in enumerate(table.names) if name == source.time)
    for other in others:
        if any(row[first] != row[other] for row in table.cells):
            raise ConfigError(
                f"{path}: columns {first} and {other}, both time stamps ({source.time}), differ:"
                " export all channels with one sample time, or with one time for all channels",
                code="RID-IMPORT-PROPOSAL",
            )
    return first


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
    percent = source is not None and source.units.get("current") == "percent"
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
        if needs_constant and percent:
            entry["rated_current_a"] = PLACEHOLDER
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
    if needs_constant and percent:
        missing.append("rated_current_a: replace `?` by the current that is 100 percent")
    return joints, tuple(missing)


def _units(
    groups: Mapping[str, ColumnGroup], source: KnownSource | None
) -> Iterator[dict[str, str]]:
    """Yield the possible units, the likeliest first."""
    given = {} if source is None else dict(source.units)
    stated = {name: _unit_in_name(group) for name, group in groups.items()}
    fixed = {name: unit for name, unit in stated.items() if unit} | given
    positions = [fixed["position"]] if "position" in fixed else ["rad", "deg", "rev"]
    for position in positions:
        likely = {"rad": "rad/s", "deg": "deg/s", "rev": "rpm"}[position]
        velocities = [fixed.get("velocity", likely)]
        if "velocity" in groups and "velocity" not in fixed:
            velocities += [each for each in ("rad/s", "deg/s", "rpm") if each != likely]
        for velocity in velocities:
            units = {"position": position}
            if "velocity" in groups:
                units["velocity"] = velocity
            for quantity in ("torque", "current", "temperature"):
                if quantity in fixed and (quantity != "current" or "torque" not in groups):
                    units[quantity] = fixed[quantity]
            yield units


def _unit_in_name(group: ColumnGroup) -> str:
    """Return the unit that the name of a group states, as a map writes it."""
    known: Mapping[str, Sequence[str]] = {
        "position": ("rad", "deg", "rev"),
        "velocity": ("rad/s", "deg/s", "rpm"),
        "torque": ("Nm", "mNm", "permille", "percent"),
        "current": ("A", "mA", "permille", "percent"),
        "temperature": ("C", "K"),
    }
    unit = {"°": "deg", "°/s": "deg/s", "°C": "C", "N m": "Nm", "Nm": "Nm"}.get(
        group.unit.strip(), group.unit.strip()
    )
    if unit in known[group.quantity]:
        return unit
    words = set(re.split(r"[^A-Za-z]+", group.pattern.lower()))
    if group.quantity in ("position", "velocity") and words & {"deg", "degree", "degrees"}:
        return {"position": "deg", "velocity": "deg/s"}[group.quantity]
    if group.quantity in ("position", "velocity") and words & {"rad", "radian", "radians"}:
        return {"position": "rad", "velocity": "rad/s"}[group.quantity]
    return ""


def _first_that_works(
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
    for unit, units in itertools.product(time_units, _units(groups, source)):
        tested = keys | {"time": keys["time"] | {"unit": unit}, "units": units}
        words = f"time in {unit}, {', '.join(f'{name} in {each}' for name, each in units.items())}"
        try:
            report = try_import(path, tested, robot)
        except DataQualityError as error:
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
            for name, each in _find_assumed_units(units, groups, source).items()
        ]
        doubts = (*doubts, *assumed)
        because = f"With these units the recording can be imported: {words}{_agreement(report)}"
        other = () if not tried else (f"Other units were tried: {'; '.join(tried)}",)
        return Proposal(tested, (*reasons, because, *other), doubts, report)
    assert first is not None
    return first


def _find_assumed_units(
    units: Mapping[str, str], groups: Mapping[str, ColumnGroup], source: KnownSource | None
) -> dict[str, str]:
    """Return the units that neither the columns nor their program state."""
    known = {} if source is None else source.units
    default = ImportUnits().model_dump() | dict(units)
    used = [name for name in groups if name != "current" or "torque" not in groups]
    return {
        name: str(default[name])
        for name in used
        if source is None and not _unit_in_name(groups[name]) and name not in known
    }


def _agreement(report: ImportReport) -> str:
    ratios = [ratio for ratio in report.velocity_ratio if ratio is not None]
    if not ratios:
        return "; no recorded velocities confirm them"
    return f"; velocities agree with positions within {100 * max(abs(r - 1) for r in ratios):.1f} %"


def try_import(path: Path, keys: Mapping[str, Any], robot: RobotDescription) -> ImportReport:
    """Import a recording with the keys of a map, and return the report.

    Raises:
        ConfigError, DataQualityError: As for `import_csv`.
    """
    import_map = ImportMap.model_validate(keys, strict=False)
    if not has_named_arrays(path):
        return import_csv(path, import_map, robot)[1]
    with TemporaryDirectory(prefix="rid-daq-") as folder:
        (file,), layout = write_array_tables((path,), import_map, Path(folder))
        return import_csv(file, import_map, robot, layout=layout)[1]


def _propose_bundled_map(path: Path, table: SourceTable, robot: RobotDescription) -> Proposal:
    """Return the bundled map with as many columns as a file without a header."""
    width = len(table.names)
    for name in bundled_names("maps"):
        import_map = load_bundled_or_path(name, "maps", ImportMap)
        if import_map.columns != width or import_map.joint_names != robot.joint_names:
            continue
        keys = import_map.model_dump(mode="json", exclude_unset=True)
        try:
            report = try_import(path, keys, robot)
        except DataQualityError:
            continue
        reasons = (
            f"The file has no header and {width} columns, as the bundled map {name} describes",
            f"The recording can be imported with it{_agreement(report)}",
        )
        return Proposal(keys, reasons, (), report)
    raise ConfigError(
        f"{path}: no import map can be proposed, because its {width} columns have no names, and no"
        f" bundled map of {robot.name} has so many columns. Write a map"
        " (`rid-daq docs someone-elses-recording`)",
        code="RID-IMPORT-PROPOSAL",
    )
