"""`check_content`: errors in a file that is not saved yet, and the help for one of its places."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.key_help import KeyHelp, describe_place
from config.load import load_cell, validate
from config.plausible import key_name
from rid_daq.service.files.edited_file import EditedFile
from rid_daq.service.records import Record
from rid_daq.service.served_cell import ServedCell

_PLACE: Final = re.compile(r"^(?P<file>[^:]+):(?P<line>\d+):(?P<column>\d+): (?P<text>.*)$")


class FileProblem(Record):
    """An error in a file.

    Attributes:
        file: Name of another file with the error; empty for the edited file.
        line, column: Place of the error, from 1; None if it has no place.
        text: Description of the error.
        code: Its code.
    """

    file: str = ""
    line: int | None = None
    column: int | None = None
    text: str
    code: str


class KeyText(Record):
    """Help for a key: name, kind, default and meaning, as in the reference of the files."""

    name: str
    kind: str
    default: str
    meaning: str

    @classmethod
    def of(cls, key: KeyHelp) -> KeyText:
        """Return the texts of a key."""
        return cls(name=key.name, kind=key.kind, default=key.default, meaning=key.meaning)


class PlaceText(Record):
    """Help for a place: the key there, and all keys that are allowed next to it."""

    path: str
    key: KeyText | None
    allowed: tuple[KeyText, ...]


class ContentCheck(Record):
    """Result of the check of a file's content.

    Attributes:
        problems: Errors of the file itself; a file with such errors is not saved.
        cell_problems: Reasons why a cell cannot be loaded with this file.
        place: Help for the place of the cursor; None if the file is not valid YAML.
    """

    problems: tuple[FileProblem, ...]
    cell_problems: tuple[FileProblem, ...]
    place: PlaceText | None


def check_content(
    file: EditedFile,
    content: bytes,
    cell: ServedCell | None = None,
    place: tuple[int, int] = (1, 1),
) -> ContentCheck:
    """Return the errors of a file's content, and the help for a place.

    Args:
        file: The file.
        content: Its new content.
        cell: Cell whose robot a motion file must name; None for any robot.
        place: Line and column of the cursor, from 1.
    """
    shown = None
    name = file.path.name
    try:
        tree = parse_yaml(content, name)
        found = describe_place(tree, file.model, *place)
        key = None if found.key is None else KeyText.of(found.key)
        allowed = tuple(map(KeyText.of, found.allowed))
        shown = PlaceText(path=key_name(found.path), key=key, allowed=allowed)
        value = validate(tree, file.model)
        if file.is_motion and cell is not None and value.root.robot != cell.loaded.robot.name:
            raise ConfigError(
                f"{tree.where(('robot',))}: robot: the motion is for {value.root.robot!r}, but the"
                f" robot of cell {cell.name} is {cell.loaded.robot.name!r}",
                code="RID-ROBOT-OTHER",
            )
    except ConfigError as error:
        return ContentCheck(problems=_problems(error, name), cell_problems=(), place=shown)
    unfit: list[FileProblem] = []
    for each in file.cells:
        try:
            load_cell(each.reference, {file.path: content})
        except ConfigError as error:
            unfit += _problems(error, name)
    return ContentCheck(problems=(), cell_problems=tuple(unfit), place=shown)


def _problems(error: ConfigError, name: str) -> tuple[FileProblem, ...]:
    """Return one problem for each line of an error.

    Args:
        error: The error.
        name: Name of the edited file.
    """
    found = []
    for line in str(error).splitlines():
        place = _PLACE.match(line)
        if place is None:
            found.append(FileProblem(text=line.removeprefix(f"{name}: "), code=error.refusal))
            continue
        file = Path(place["file"]).name
        found.append(
            FileProblem(
                file="" if file == name else file,
                line=int(place["line"]),
                column=int(place["column"]),
                text=place["text"],
                code=error.refusal,
            )
        )
    return tuple(found)
