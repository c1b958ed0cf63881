"""`JudgeSplit`: what of a real robot's recordings trains a model, and what judges it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Final

import yaml
from pydantic import Field, ValidationError

from config.model import ConfigModel

SHIPPED: Final = Path(__file__).with_name("judge_splits")
FILE: Final = "judge.yaml"

Percents = tuple[Annotated[float, Field(gt=0.0)] | None, ...]


class Piece(ConfigModel):
    """A recording of the folder, or rows of it, as `rid-daq import --rows` counts them."""

    file: str
    rows: Annotated[str, Field(pattern=r"^\d+-\d+$")] | None = None


class Bar(ConfigModel):
    """Largest relative errors [%], one a joint, null where anything will do."""

    moving_percent: Percents = ()
    all_percent: Percents = ()


class JudgeSplit(ConfigModel):
    """How one robot's recordings are used.

    `map` is a file of the folder or a bundled name; it names the robot file, likewise. What is
    trained on `train` predicts each piece of `judge`, and the other way round. `bar` is for the
    first way.
    """

    map: str
    train: tuple[Piece, ...] = Field(min_length=1)
    judge: tuple[Piece, ...] = Field(min_length=1)
    bar: Bar = Bar()


def find_splits(folder: Path) -> dict[Path, JudgeSplit]:
    """Return every folder below `folder` with a `judge.yaml`, or one shipped by its name.

    Raises:
        ValueError: A file is not a split; the message names file and key.
    """
    found = {}
    for place in sorted(path for path in [folder, *folder.rglob("*")] if path.is_dir()):
        own, shipped = place / FILE, SHIPPED / f"{place.name}.yaml"
        source = own if own.is_file() else shipped
        if not source.is_file():
            continue
        try:
            tree = yaml.safe_load(source.read_text(encoding="utf-8"))
            split = JudgeSplit.model_validate_json(json.dumps(tree))
        except (yaml.YAMLError, ValidationError) as error:
            raise ValueError(f"{source}: {error}") from None
        if all((place / piece.file).is_file() for piece in (*split.train, *split.judge)):
            found[place] = split
        else:
            print(f"{place}: left out, a recording that {source.name} names is not there")
    return found
