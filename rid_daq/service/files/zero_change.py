"""`ZeroChange`: a cell file with the zero of the force plate that a run has measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.cell.plate import PlateConfig, PlateZero
from config.errors import ConfigError
from config.formats.approved_files import sha256_of
from config.formats.yaml_tree import parse_yaml
from config.load import validate
from config.model import ConfigModel
from rid_daq.runs.plate_zero_lines import ZERO_FILE, replace_zero, run_of_zero, zero_source
from rid_daq.service.files.edited_file import EditedFile
from rid_daq.service.served_cell import ServedCell

if TYPE_CHECKING:
    from rid_daq.service.service import CellService

CELL_FILE = "cell.yaml"


class _ZeroFile(ConfigModel):
    """Content of the file in which a run keeps its zero."""

    zero: PlateZero


@dataclass(frozen=True)
class ZeroChange:
    """Change of `plate.zero` in a cell file; nothing is written yet.

    Attributes:
        file: The cell file.
        version: SHA-256 of its present content.
        before: Zero in the file; None if it has none.
        after: Zero that the run has measured.
        measured_utc: Time of the run.
        content: The file's content with the new zero; everything else is as before.
    """

    file: EditedFile
    version: str
    before: PlateZero | None
    after: PlateZero
    measured_utc: str
    content: bytes

    @classmethod
    def of(cls, service: CellService, cell: ServedCell, run: RunFolder) -> ZeroChange:
        """Return the change of a cell's file to the zero of a run.

        Raises:
            ConfigError: The run has no valid zero of this cell and plate, or the file cannot be
                changed without changing other keys (`RID-PLATE-ZERO-WRITE`).
            RecordingError: The run's files cannot be read, or have changed.
        """
        path = cell.loaded.path
        if path is None:
            raise ConfigError(
                f"cell {cell.name} is bundled with the program, for practice: it has no file that"
                " keeps a zero",
                code="RID-PLATE-ZERO-WRITE",
            )
        after = _measured_zero(cell, run)
        file = EditedFile.of_path(service, path.resolve(), path.name, CellConfig)
        before = file.read()
        if before is None:
            raise ConfigError(f"{file.shown}: the file is missing", code="RID-FILE-READ")
        plate = validate(parse_yaml(before, file.shown), CellConfig).plate
        kept = parse_yaml(run.read(CELL_FILE), f"{run.run_id}/{CELL_FILE}")
        if plate is None or _without_zero(plate) != _without_zero(validate(kept, CellConfig).plate):
            raise ConfigError(
                f"{file.shown}: `plate` has changed since run {run.run_id} measured the zero: zero"
                " the plate again",
                code="RID-PLATE-ZERO-WRITE",
            )
        if (present := run_of_zero(before.decode())) > run.run_id:
            raise ConfigError(
                f"{file.shown}: `plate.zero` was measured by run {present}, which is later than run"
                f" {run.run_id}: keep this zero, or zero the plate again",
                code="RID-PLATE-ZERO-WRITE",
            )
        text = replace_zero(before.decode(), after, file.shown, zero_source(run.run_id))
        when = run.manifest().created_utc
        return cls(file, sha256_of(before), plate.zero, after, when, text.encode())


def _measured_zero(cell: ServedCell, run: RunFolder) -> PlateZero:
    facts = run.manifest().facts
    if facts.get("cell") != cell.name or facts.get("zeroed") is not True:
        raise ConfigError(
            f"run {run.run_id} has no zero of cell {cell.name} that passed its check: zero the"
            " plate again",
            code="RID-PLATE-ZERO-WRITE",
        )
    return validate(parse_yaml(run.read(ZERO_FILE), ZERO_FILE), _ZeroFile).zero


def _without_zero(plate: PlateConfig | None) -> PlateConfig | None:
    return None if plate is None else plate.model_copy(update={"zero": None})
