"""Import: separators of thousands are never read as decimal separators."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap
from config.errors import DataQualityError
from tests.builders.foreign_tables import sound_table, two_joint_map
from tests.builders.raised_codes import raises_code


def layout(decimal: str) -> ImportMap:
    return two_joint_map().model_copy(update={"delimiter": ";", "decimal": decimal})


def write(path: Path, table: np.ndarray, torques: list[str], decimal: str) -> Path:
    """Write a table with the texts `torques` in its last column, the torque of the second joint."""
    lines = [";".join(f"{value:.9f}" for value in row[:-1]) for row in table]
    rows = [
        f"{line.replace('.', decimal)};{text}" for line, text in zip(lines, torques, strict=True)
    ]
    path.write_text("\n".join([*rows, ""]))
    return path


def whole_numbers(count: int) -> np.ndarray:
    return np.round(9000.0 * np.sin(0.05 * np.arange(count))).astype(int)


@pytest.mark.parametrize("sign", [".", ","])
def test_whole_numbers_with_separators_of_thousands_are_refused(tmp_path: Path, sign: str) -> None:
    table = sound_table()
    texts = [f"{value:,}".replace(",", sign) for value in whole_numbers(len(table)).tolist()]
    path = write(tmp_path / "recording.csv", table, texts, sign)
    first = next(row for row, text in enumerate(texts, 1) if sign in text)
    with raises_code(DataQualityError, "RID-IMPORT-UNITS", f"row {first}", "column 6"):
        import_csv(path, layout(sign))


@pytest.mark.parametrize("form", ["{:.3f}", "{:g}", "{:.0f}"])
def test_decimal_numbers_with_rests_are_read(tmp_path: Path, form: str) -> None:
    """The torque is 5 at rest; in motion it has three decimals, or is rounded to a whole number."""
    table = sound_table()
    torque = np.round(np.where(np.arange(len(table)) % 300 < 100, 5.0, 7.5 + table[:, 6]), 3)
    path = write(tmp_path / "recording.csv", table, [form.format(each) for each in torque], ".")
    recording, _ = import_csv(path, layout("."))
    atol = 0.5 if form == "{:.0f}" else 1e-5
    np.testing.assert_allclose(
        recording.torque_nm[:, 1], torque[: len(recording.time_s)], atol=atol
    )


@pytest.mark.parametrize("form", ["{:,.3f}", "{:_.3f}"])
def test_other_groups_of_digits_are_refused(tmp_path: Path, form: str) -> None:
    table = sound_table()
    texts = [form.format(2000.5 + value).replace("_", "'") for value in table[:, 6].tolist()]
    path = write(tmp_path / "recording.csv", table, texts, ".")
    with raises_code(DataQualityError, "RID-IMPORT-ROWS", "recording.csv"):
        import_csv(path, layout("."))
