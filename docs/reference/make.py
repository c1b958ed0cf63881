"""Write the reference pages from the code: `python docs/reference/make.py`.

`tests/test_reference.py` fails if a page differs from the code.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import json
import os
import re
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from acquisition.maps.import_map import ImportMap
from acquisition.motion.load_changes import LoadChanges
from acquisition.motion.motion_file import AnyMotion
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.servo_profile import ServoProfile
from config.key_help import describe_keys, describe_model
from config.robot.robot import RobotDescription
from config.simulation.faults import FaultScript
from config.simulation.plant import PlantConfig
from identification.model.known_loads import KnownLoads

HERE = Path(__file__).resolve().parent
GUIDE = HERE.parent / "guide" / "your-own-drives.md"
MOTIONS = typing.get_args(typing.get_args(AnyMotion)[0])


def _kind_name(model: type[BaseModel]) -> str:
    """Return the kind of motion that a model describes: the value of its key `kind`."""
    return str(typing.get_args(model.model_fields["kind"].annotation)[0])


PAGES = {
    "cell files": CellConfig,
    "robot files": RobotDescription,
    **{f"motion files: {_kind_name(model)}": model for model in MOTIONS},
    "import maps": ImportMap,
    "load files (known bodies)": KnownLoads,
    "load-change files": LoadChanges,
    "servo profiles (drives of one manufacturer)": ServoProfile,
    "drive profiles (Modbus registers)": DriveProfile,
    "amplifier profiles (commands and row formats)": AmplifierProfile,
    "plant files (simulation only)": PlantConfig,
    "fault scripts (simulation only)": FaultScript,
}


def command_line() -> str:
    """Return the page of the command line: the help of every command."""
    os.environ.update(COLUMNS="80", TERMINAL_WIDTH="80", NO_COLOR="1")

    from rid_daq.command_line.root import COMMANDS

    parts = [
        "# Command line\n\nThis page is generated from the help texts of the program.\n",
        _help([]),
    ]
    for name in COMMANDS:
        parts.append(f"## {name}\n\n{_help([name])}")
        parts += [f"### {name} {own}\n\n{_help([name, own])}" for own in _subcommands(name)]
    return "\n".join(parts)


def files() -> str:
    """Return the page of the file formats: kind, default and meaning of every key."""
    parts = [
        "# Files\n\nThis page is generated from the schemas of the files. Every file is YAML; an"
        " unknown key is an error. `rid-daq init DIR` writes commented examples.\n\nA value outside"
        " its plausible range is refused; the message names the unit that was probably used. If"
        " such a value is correct, add its key as in the message to the file, for example"
        " `implausible_on_purpose: [joints.0.limits.torque]`.\n"
    ]
    seen: list[type[BaseModel]] = []
    for title, model in PAGES.items():
        parts.append(f"## {title[0].upper()}{title[1:]}\n")
        if model in seen:
            parts.append(f"See [{model.__name__}](#{model.__name__.lower()}).\n")
        else:
            _model(model, seen, parts)
    return "\n".join(parts)


def drive_objects() -> str:
    """Return the guide's table of drive objects, with the remedy if a drive lacks one."""
    from config.load import load_cell
    from drivers.servo.cia402 import AxisUnits, MotorRatings
    from drivers.servo.motor_ratings import rating_requirements
    from drivers.servo.requirements import (
        Requirement,
        cyclic_pdos,
        kind_requirements,
        safety_requirements,
    )
    from rid_daq.preflight.drive_advice import REPLACED_BY

    cell, profile = load_cell("ir361").config, ServoProfile()
    motor, units = MotorRatings(1.0, 1.0, 1.0, 1.0), AxisUnits(1.0, 1.0, 1.0, 1.0)
    mapped = [item for pdo in cyclic_pdos(1, "full") for item in pdo.objects]
    needed = (
        *kind_requirements(profile),
        *rating_requirements(profile),
        *safety_requirements(cell, profile, motor, units, 1.0),
        *(Requirement(item.index, item.subindex, item.bits // 8, "in a PDO") for item in mapped),
    )
    without = {
        "shown": "the drive can be used",
        "trial": "the drive's reaction is tested before every motion, with power and at rest",
        "red": "the drive cannot be used",
    }
    rows = ["| object | name | if a drive lacks the object |", "|---|---|---|"]
    for each in needed:
        object_name, index = f"{each.index:04X}h:{each.subindex:02X}", f"{each.index:04X}"
        instead = without[each.lack] if each.lack != "red" else REPLACED_BY.get(index)
        if each.watchdog and each.lack == "red":
            instead = REPLACED_BY.get(index, "the drive cannot be used")
            instead += "; accepted if `allow_drive_without_watchdog` lists the drive"
        rows.append(f"| {object_name} | {each.name} | {instead or without['red']} |")
    return "\n".join(rows) + "\n"


def servo_profiles() -> str:
    """Return the guide's table of bundled profiles, with the keys that a cell file must set."""
    from config.load import bundled_names, load_bundled_or_path

    rows = ["| `servo` | mode | torque | keys that the cell file must set |", "|---|---|---|---|"]
    for name in bundled_names("servos"):
        profile = load_bundled_or_path(name, "servos", ServoProfile)
        names = []
        if profile.encoder_increments is None and (
            "608Fh" in profile.lacks or profile.sets_increments
        ):
            names.append("`encoder_increments`")
        if profile.torque.of != "rated_torque":
            names.append("`torque_constant_nm_per_a`")
        elif "6076h" in profile.lacks:
            names.append("`rated_torque_nm`")
        mode, of = profile.mode.replace("_", " "), profile.torque.of.replace("_", " ")
        own = ", ".join(names) or "nothing"
        rows.append(f"| `{name}` | {mode} | {profile.torque.object}, of {of} | {own} |")
    return "\n".join(rows) + "\n"


def results() -> str:
    """Return the page of `result.json`: kind, default and meaning of every key."""
    from rid_daq.report.result import SCHEMA, Result

    parts = [
        "# Results\n\nThis page is generated from the schema of `result.json`. This file of a run"
        " contains every number of the run's report; its JSON schema is `result.schema.json`, next"
        " to this page. If a key is left out or null, nothing was computed for it. Within a version"
        f" of the document (`schema`: {SCHEMA!r}) keys can be added, but none is renamed or"
        " removed.\n\n## The document\n"
    ]
    _model(Result, [], parts)
    return "\n".join(parts)


def result_schema() -> str:
    """Return the JSON schema of `result.json`."""
    from rid_daq.report.result import Result

    return json.dumps(Result.model_json_schema(), ensure_ascii=False, indent=1) + "\n"


def python_api() -> str:
    """Return the page of the Python API: every public name with its signature and docstring."""
    from rid_daq import api

    parts = [
        f"# Python API\n\nThis page is generated from the docstrings of API version"
        f" {api.API_VERSION}. [The guide](../guide/use-from-python.md) contains examples.\n\n"
        f"{_markdown(api)}\n"
    ]
    for name in sorted(set(api.__all__) - {"API_VERSION", "RidDaqError"}, key=str.lower):
        found = getattr(api, name)
        if not inspect.isclass(found):
            parts.append(f"## {name}\n\n{_signature(name, found)}\n{_markdown(found)}\n")
            continue
        parts.append(f"## {name}\n\n{_markdown(found)}\n")
        for own, member in vars(found).items():
            if own.startswith("_") or own == "blocks":
                continue
            if isinstance(member, property):
                parts.append(f"### {name}.{own}\n\n{_markdown(member)}\n")
            elif isinstance(member, classmethod) or inspect.isfunction(member):
                bound = getattr(found, own)
                text = f"{_signature(f'{name}.{own}', bound)}\n{_markdown(bound)}"
                parts.append(f"### {name}.{own}\n\n{text}\n")
    return "\n".join(parts)


def _signature(name: str, of: Any) -> str:
    """Return a function's signature as Markdown: parameters, defaults and return type."""
    found = inspect.signature(of)
    parameters = [
        each.replace(annotation=inspect.Parameter.empty)
        for each in found.parameters.values()
        if each.name != "self"
    ]
    shown = found.replace(parameters=parameters, return_annotation=inspect.Signature.empty)
    result = str(found.return_annotation).replace("Self", name.partition(".")[0])
    return f"```python\n{name}{shown} -> {result}\n```\n"


def _markdown(of: Any) -> str:
    """Return an object's docstring as Markdown, with its sections as lists."""
    text = inspect.getdoc(of) or ""
    text = re.sub(r"^(Args|Returns|Raises|Yields|Attributes):$", r"**\1**\n", text, flags=re.M)
    lines: list[str] = []
    for line in text.splitlines():
        entry = (
            re.fullmatch(r" {4}(\S.*?): (.*)", line) if "**Returns**" not in lines[-3:] else None
        )
        if entry is not None:
            names = ", ".join(f"`{each}`" for each in entry[1].split(", "))
            lines.append(f"- {names}: {entry[2]}")
        elif line.startswith("        "):
            lines.append(f"  {line.strip()}")
        else:
            is_code = line.startswith("    ") and "**" not in "".join(lines[-9:])
            lines.append(line if is_code else line.strip())
    return "\n".join(lines)


def _subcommands(name: str) -> list[str]:
    """Return the subcommands of a command."""
    from rid_daq.command_line.root import command_words

    return [words[1] for words in command_words() if len(words) > 1 and words[0] == name]


def _help(arguments: list[str]) -> str:
    from rid_daq.app import run

    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        run([*arguments, "--help"])
    text = "\n".join(line.rstrip() for line in output.getvalue().splitlines())
    return f"```\n{text.strip()}\n```\n"


def _model(model: type[BaseModel], seen: list[type[BaseModel]], parts: list[str]) -> None:
    seen.append(model)
    text = describe_model(model)
    parts.append(f"### {model.__name__}\n\n{text}\n")
    parts.append("| key | kind | default | meaning |\n|---|---|---|---|")
    inner: list[type[BaseModel]] = []
    for key in describe_keys(model):
        meaning = key.meaning.replace("|", "\\|")
        parts.append(f"| `{key.name}` | {key.kind} | {key.default} | {meaning} |")
        inner += key.models
    parts.append("")
    for child in inner:
        if child not in seen:
            _model(child, seen, parts)


def main() -> None:
    """Write all pages."""
    (HERE / "command-line.md").write_text(command_line(), encoding="utf-8")
    (HERE / "files.md").write_text(files(), encoding="utf-8")
    (HERE / "results.md").write_text(results(), encoding="utf-8")
    (HERE / "result.schema.json").write_text(result_schema(), encoding="utf-8")
    (HERE / "python-api.md").write_text(python_api(), encoding="utf-8")
    text = GUIDE.read_text(encoding="utf-8")
    for title, table in (("objects", drive_objects()), ("profiles", servo_profiles())):
        begin, end = (text.index(f"<!-- {title}{mark} -->\n") for mark in ("", " end"))
        text = f"{text[:begin]}<!-- {title} -->\n{table}{text[end:]}"
    GUIDE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
