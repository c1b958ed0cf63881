"""Loading of cell, robot, plant and all other YAML files; errors name file, line and column."""

from __future__ import annotations

import difflib
import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from config.cell.amplifier_profile import AmplifierProfile, require_line
from config.cell.cell import CellConfig, Servo
from config.cell.drive_eds_files import read_eds_files, with_identities
from config.cell.drive_profile import DriveProfile
from config.cell.plate import PlateConfig
from config.cell.robot_fit import check_robot_fit
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError, system_errors
from config.formats.approved_files import sha256_of
from config.formats.bounded_file import read_file
from config.formats.eds import ElectronicDataSheet
from config.formats.file_kinds import wrong_kind
from config.formats.json_file import parse_json
from config.formats.yaml_tree import MAX_BYTES, YamlTree, dump_yaml, parse_yaml
from config.plausible import implausible, key_name
from config.refusals import PLACEHOLDER, describe_error, without_other_kinds
from config.robot.robot import RobotDescription
from config.simulation.faults import FaultScript
from config.simulation.plant import PlantConfig

T = TypeVar("T")

_MANIFEST = "manifest.json"  # marks a run folder
_MANIFEST_BYTES = 4 << 20


@dataclass(frozen=True)
class LoadedCell:
    """A cell file with the files that it names, and their bytes as used.

    `path` is the cell file; None for a bundled one. `files` are the bytes by the names under which
    a run folder stores them, and `disk_names` the paths on disk by the same names, without bundled
    files. `hashes` are the SHA-256 by these paths. `eds_files` are the EDS of the drives, one per
    axis, None for an axis without one. Their 1018h entries are in the axes' `identity`.
    """

    config: CellConfig
    robot: RobotDescription
    plant: PlantConfig | None
    files: dict[str, bytes]
    amplifier_profile: AmplifierProfile | None = None
    drive_profile: DriveProfile | None = None
    eds_files: tuple[ElectronicDataSheet | None, ...] = ()
    path: Path | None = None
    hashes: Mapping[Path, str] = field(default_factory=dict)
    disk_names: Mapping[str, Path] = field(default_factory=dict)

    @property
    def meshes(self) -> bytes | None:
        """Bytes of the file with the meshes of the robot's links; None without one."""
        return None if self.robot.meshes is None else self.files[self.robot.meshes.file]

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths on disk of the files that were read; bundled files are not included."""
        return tuple(self.hashes)

    @functools.cached_property
    def files_hash(self) -> str:
        """Hash of all files; it changes if any file changes."""
        digest = hashlib.sha256()
        for name, content in sorted(self.files.items()):
            digest.update(f"{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()


def load_cell(reference: str, unsaved: Mapping[Path, bytes] | None = None) -> LoadedCell:
    """Load a cell and all files that it names, such as its robot, plant and drive files.

    If the cell file is in a run folder, the copies of the other files in that folder are used.

    Args:
        reference: The name of a bundled cell, or a path to a cell file.
        unsaved: Bytes to use instead of the content of YAML files on disk, by resolved paths.

    Raises:
        ConfigError: A file is missing or invalid, or two files contradict each other.
    """
    text, name, folder = read_named(reference, "cells", None, unsaved=unsaved)
    cell_tree = parse_yaml(text, name)
    cell = validate(cell_tree, CellConfig)
    kept = folder if folder is not None and _is_run_folder(folder) else None
    files = {"cell.yaml": text}
    disk_names = {} if folder is None else {"cell.yaml": Path(name).absolute()}
    folders: dict[str, Path | None] = {}

    def read(reference: str, kind: str, file: str, model: type[T]) -> tuple[YamlTree, T]:
        files[file], shown, beside = read_named(
            reference, kind, folder, kept, file, unsaved=unsaved
        )
        folders[file] = beside
        if beside is not None:
            disk_names[file] = Path(shown).absolute()
        tree = parse_yaml(files[file], shown)
        return tree, validate(tree, model)

    _, robot = read(cell.robot, "robots", "robot.yaml", RobotDescription)
    beside = folders["robot.yaml"]
    if robot.meshes is not None and beside is not None:
        files[robot.meshes.file] = robot.meshes.read(beside)
        disk_names[robot.meshes.file] = (beside / robot.meshes.file).absolute()
    moved = tuple(axis.joint for axis in cell.axes)
    if moved != robot.joint_names:
        raise ConfigError(
            f"{cell_tree.where(('axes',))}: axes move {', '.join(moved)}, but robot {robot.name}"
            f" has {', '.join(robot.joint_names)}: list one axis per joint, in the robot's order",
            code="RID-CELL-JOINTS",
        )
    plant = profile = drive_profile = None
    if cell.plant is not None:
        plant_tree, plant = read(cell.plant, "plants", "plant.yaml", PlantConfig)
        _check_plant(plant_tree, plant, robot)
    if cell.plate is not None:
        named = cell.plate.amplifier.profile
        _, profile = read(named, "profiles", "amplifier.yaml", AmplifierProfile)
        _check_line(cell_tree, cell.plate, profile, cell.cycle_time_s)
    if cell.monitor is not None:
        _, drive_profile = read(cell.monitor.profile, "profiles", "drives.yaml", DriveProfile)
    servos: dict[str, ServoProfile] = {}

    def resolve(chosen: Servo, otherwise: ServoProfile) -> ServoProfile:
        if isinstance(chosen, ServoProfile):
            below = otherwise if chosen.base is None else resolve(chosen.base, otherwise)
            return chosen.on(below)
        if chosen not in servos:
            # end the recursion if a profile names itself as its base
            servos[chosen] = ServoProfile()
            _, named = read(chosen, "servos", f"servo{len(servos)}.yaml", ServoProfile)
            servos[chosen] = resolve(named, ServoProfile())
        return servos[chosen]

    general = resolve(cell.servo, ServoProfile())
    axes = tuple(
        axis.model_copy(update={"servo": axis.servo and resolve(axis.servo, general)})
        for axis in cell.axes
    )
    cell = cell.model_copy(update={"servo": general, "axes": axes})
    _check_servos(cell_tree, cell)
    _check_cycle_time(cell_tree, cell)
    check_robot_fit(cell_tree, cell, robot)
    eds_files, eds_bytes, eds_paths = read_eds_files(cell_tree, cell, folder, kept)
    files |= eds_bytes
    for path, kept_name in zip(eds_paths, eds_bytes, strict=True):
        disk_names[kept_name] = path.absolute()
    return LoadedCell(
        with_identities(cell, eds_files),
        robot,
        plant,
        files,
        profile,
        drive_profile,
        eds_files,
        None if folder is None else Path(name),
        {path: sha256_of(files[kept_name]) for kept_name, path in disk_names.items()},
        disk_names,
    )


def load_robot(reference: str) -> RobotDescription:
    """Load a robot: a bundled name, or a path.

    Raises:
        ConfigError: The file is missing or invalid.
    """
    return load_bundled_or_path(reference, "robots", RobotDescription)


def load_faults(path: str | Path, cell: CellConfig) -> FaultScript:
    """Load a fault script for a simulated cell.

    Raises:
        ConfigError: The file is missing or invalid, or names a joint that the cell does not have.
    """
    return read_faults(path, cell)[0]


def read_faults(path: str | Path, cell: CellConfig) -> tuple[FaultScript, bytes]:
    """Return a fault script and the bytes of its file; errors are those of `load_faults`."""
    text, name, _ = read_named(str(path), "faults", None)
    tree = parse_yaml(text, name)
    script = validate(tree, FaultScript)
    joints = [axis.joint for axis in cell.axes]
    for part, faults in (("bus", script.bus), ("drives", script.drives)):
        for number, fault in enumerate(faults):
            joint = getattr(fault, "joint", None)
            if joint is not None and joint not in joints:
                raise ConfigError(
                    f"{tree.where((part, number, 'joint'))}: cell {cell.name} has no joint"
                    f" {joint!r}; it has {', '.join(joints)}",
                    code="RID-CELL-JOINTS",
                )
    return script, text


def load_bundled_or_path(reference: str, kind: str, model: type[T]) -> T:
    """Load any other kind of file: a name bundled under `kind`, or a path.

    Raises:
        ConfigError: The file is missing or invalid.
    """
    text, name, _ = read_named(reference, kind, None)
    return validate(parse_yaml(text, name), model)


def read_named(
    reference: str,
    kind: str,
    folder: Path | None,
    kept: Path | None = None,
    kept_name: str = "",
    *,
    unsaved: Mapping[Path, bytes] | None = None,
) -> tuple[bytes, str, Path | None]:
    """Return a file's bytes, its name and its folder.

    Args:
        reference: A name bundled under `kind`, or a path.
        kind: The folder of bundled files, such as cells, robots or maps; there need not be one, as
            for motions.
        folder: Base of a relative path; the working folder if None.
        kept: A run folder. If it contains `kept_name`, that copy is read instead of `reference`.
        kept_name: The copy's name.
        unsaved: Bytes to return instead of the content of files on disk, by resolved paths.

    Raises:
        ConfigError: The file does not exist or cannot be read; for a plain name that is not
            bundled, the text lists the bundled names.
    """
    if kept is not None and (kept / kept_name).is_file():
        reference, folder = str(kept.absolute() / kept_name), None
    looks_like_path = "/" in reference or "\\" in reference or reference.endswith((".yaml", ".yml"))
    if not looks_like_path and reference in bundled_names(kind):
        resource = resources.files("config") / "bundled" / kind / f"{reference}.yaml"
        return resource.read_bytes(), f"{reference}.yaml (bundled)", None
    path = Path(reference).expanduser()
    if folder is not None and not path.is_absolute():
        path = folder / path
    if not looks_like_path and not path.is_file():
        if (path / f"{kind[:-1]}.yaml").is_file():
            raise ConfigError(
                f"{path}: is a folder; give {path / f'{kind[:-1]}.yaml'}", code="RID-FILE-UNKNOWN"
            )
        names = bundled_names(kind)
        hint = difflib.get_close_matches(reference, names, n=1)
        meant = f" Did you mean {hint[0]}?" if hint else ""
        if kind == "cells" and reference in bundled_names("robots"):
            meant = f" {reference!r} is a robot: name it as `robot` of a cell (Python: Robot.load)."
        known = f" Bundled {kind}: {', '.join(names)}." if names else ""
        raise ConfigError(
            f"no file and no bundled {kind[:-1]} {reference!r}.{meant}{known}",
            code="RID-FILE-UNKNOWN",
        )
    with system_errors(ConfigError, f"{path}: cannot read", code="RID-FILE-READ"):
        content = (unsaved or {}).get(path.resolve())
        return read_file(path, MAX_BYTES) if content is None else content, str(path), path.parent


def bundled_names(kind: str) -> tuple[str, ...]:
    """Return the names bundled under `kind`, such as cells or robots; empty without files."""
    folder = resources.files("config") / "bundled" / kind
    if not folder.is_dir():
        return ()
    return tuple(sorted(item.name[:-5] for item in folder.iterdir() if item.name.endswith(".yaml")))


def to_yaml(model: BaseModel, comment: str = "") -> str:
    """Return a configuration model as YAML text that loads back to an equal model."""
    return dump_yaml(model.model_dump(mode="json"), comment)


def validate(tree: YamlTree, model: type[T]) -> T:
    """Turn a YAML tree into a validated model, strictly: no value is converted silently.

    Values outside their plausible range are refused, unless `implausible_on_purpose` of the file
    lists their keys.

    Raises:
        ConfigError: One line per error (at most 20), each with `file:line:column`, the key and what
            is allowed; or one line that names the type of a wrong file.
    """
    try:
        file = TypeAdapter(model).validate_json(tree.json())
    except ValidationError as error:
        details = error.errors(include_url=False)
        other = wrong_kind(tree, getattr(model, "__name__", ""))
        lines = other or [
            describe_error(tree, each, model) for each in without_other_kinds(tree, details)
        ]
        code = "RID-FILE-VALUE"
        if any(detail["input"] == PLACEHOLDER for detail in details):
            code = "RID-FILE-PLACEHOLDER"
        elif other:
            code = "RID-FILE-TYPE"
        raise _validation_error(tree, lines, code) from None
    found = [f"{tree.where(path)}: {key_name(path)}: {words}" for path, words in implausible(file)]
    if found:
        raise _validation_error(tree, found, "RID-FILE-VALUE")
    return file


def _validation_error(tree: YamlTree, lines: list[str], code: str) -> ConfigError:
    """Return an error with one line per problem, at most 20 lines."""
    more = [f"{tree.name}: … and {len(lines) - 20} more"] if len(lines) > 20 else []
    return ConfigError("\n".join((*lines[:20], *more)), code=code)


def _is_run_folder(folder: Path) -> bool:
    """Return whether a folder is a run folder, judged by its manifest."""
    path = folder / _MANIFEST
    if not path.is_file():
        return False
    try:
        manifest = parse_json(read_file(path, _MANIFEST_BYTES))
    except (OSError, ConfigError):
        return False
    return isinstance(manifest, dict) and {"run_id", "files"} <= manifest.keys()


def _check_plant(tree: YamlTree, plant: PlantConfig, robot: RobotDescription) -> None:
    n = len(robot.joints)
    for key, entries in (("links", plant.links), ("axes", plant.axes)):
        if len(entries) != n:
            raise ConfigError(
                f"{tree.where((key,))}: {len(entries)} {key} for {n} joints; give one per joint",
                code="RID-PLANT-UNFIT",
            )
    if plant.unmodelled is not None and len(plant.unmodelled.axes) != n:
        raise ConfigError(
            f"{tree.where(('unmodelled', 'axes'))}: {len(plant.unmodelled.axes)} axes"
            f" for {n} joints; give one per joint",
            code="RID-PLANT-UNFIT",
        )
    if (plant.spring is None) != (robot.spring is None):
        raise ConfigError(
            f"{tree.where(('spring',))}: spring is given in only one of plant and robot; give it"
            " in both or in neither",
            code="RID-PLANT-UNFIT",
        )


def _check_servos(tree: YamlTree, cell: CellConfig) -> None:
    """Refuse drives whose profile contradicts the keys that cell or axis add to it."""
    for number, axis in enumerate(cell.axes):
        try:
            cell.servo_of(axis).check_complete()
        except ValueError as error:
            where = tree.where(("axes", number) if axis.servo is not None else ("servo",))
            raise ConfigError(
                f"{where}: the drive of {axis.joint}: {error}", code="RID-CELL-VALUE"
            ) from None
        except ConfigError as error:
            where = tree.where(("axes", number))
            raise ConfigError(f"{where}: {error}", code=error.refusal) from None


def _check_cycle_time(tree: YamlTree, cell: CellConfig) -> None:
    try:
        cell.check_cycle_time()
    except ConfigError as error:
        where = tree.where(("cycle_time_ms",))
        raise ConfigError(f"{where}: {error}", code=error.refusal) from None


def _check_line(
    tree: YamlTree, plate: PlateConfig, profile: AmplifierProfile, cycle_time_s: float
) -> None:
    try:
        require_line(plate.amplifier, profile, cycle_time_s)
    except ConfigError as error:
        where = tree.where(("plate", "amplifier", "rate_hz"))
        raise ConfigError(
            f"{where}: plate.amplifier.rate_hz: {error}", code=error.refusal
        ) from None
