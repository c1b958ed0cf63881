"""`JudgeSplit`: the recordings of a real robot for training and those for validation."""

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
    """A recording in the folder, or some of its rows, as by `rid-daq import --rows`."""

    file: str
    rows: Annotated[str, Field(pattern=r"^\d+-\d+$")] | None = None


class Bar(ConfigModel):
    """Largest relative error of each joint [%]; null for no limit.

    `moving_percent` and `all_percent` apply to the samples in motion and to all samples;
    `away_percent` applies to the samples away from standstill (`benchmarks.judged_rows`).
    """

    moving_percent: Percents = ()
    away_percent: Percents = ()
    all_percent: Percents = ()


class JudgeSplit(ConfigModel):
    """Recordings of one robot for training and for validation.

    `map` is an import map: a file in the folder, or the name of a bundled one. The same applies to
    the robot file that the map names. In the first direction a model of the recordings `train`
    predicts those of `judge`; in the second direction the two are exchanged. `bar` has the largest
    allowed errors in the first direction.
    """

    map: str
    train: tuple[Piece, ...] = Field(min_length=1)
    judge: tuple[Piece, ...] = Field(min_length=1)
    bar: Bar = Bar()


def find_splits(folder: Path) -> dict[Path, JudgeSplit]:
    """Return the splits of the folders below `folder`: from `judge.yaml`, or bundled by name.

    Raises:
        ValueError: A file is not a valid split; the message names file and key.
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
            print(f"{place}: skipped, a recording that {source.name} names is missing")
    return found
