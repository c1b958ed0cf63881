"""Amplifier profiles: allowed content, and the data rate that their rows need."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from config.cell.amplifier_profile import AmplifierProfile, highest_rate_hz, line_load, require_line
from config.cell.drive_profile import DriveProfile
from config.cell.plate import AmplifierConfig
from config.errors import ConfigError
from config.load import bundled_names, load_bundled_or_path, load_cell
from tests.builders.raised_codes import line_of, raises_code

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)


def amplifier(**changes: object) -> AmplifierConfig:
    settings: dict[str, object] = {
        "address": "/dev/ttyUSB0",
        "baud_rate": 460800,
        "rate_hz": 1000.0,
        "low_pass_hz": 50.0,
        "range_n": (5000.0,) * 8,
        "sensitivity_pc_n": (-7.5,) * 8,
    }
    return AmplifierConfig.model_validate(settings | changes)


def test_every_bundled_profile_loads() -> None:
    for name in bundled_names("profiles"):
        kind: type[DriveProfile | AmplifierProfile]
        kind = DriveProfile if name == "servo_registers" else AmplifierProfile
        assert load_bundled_or_path(name, "profiles", kind).name == name


def replace_text(old: str, new: str) -> str:
    text = PROFILE.model_dump_json()
    assert old in text
    with pytest.raises(ValidationError) as caught:
        AmplifierProfile.model_validate_json(text.replace(old, new, 1))
    (error,) = caught.value.errors()
    return error["msg"]


def test_mistakes_in_a_profile_are_named() -> None:
    assert "commands: ID" in replace_text('"text":"RG"', '"text":"ID"')
    assert "`source`" in replace_text('"verified":false', '"verified":true')
    assert "'{sequence:oct4}" in replace_text("{sequence:hex4}", "{sequence:oct4}")
    assert "sequence, time, status, counts, checksum" in replace_text("{sequence:hex4},", "")
    assert "hex8" in replace_text("{time:hex8}", "{time:hex4}")
    assert "dec6" in replace_text("{counts:dec6}", "{counts:hex4}")
    assert "u4" in replace_text("{time:u4}", "{time:u2}")
    assert repr(b"\xa5\x5a") in replace_text("A5C3", "A55A")
    assert "ascii: '{sequence:hex4}" in replace_text("#{sequence", "{sequence")
    assert "'row'" in replace_text("A55A", "row")


@pytest.mark.parametrize(
    ("form", "baud_rate", "rows"),
    [
        ("ascii", 115200, 149),
        ("ascii", 921600, 1199),
        ("binary", 230400, 781),
        ("binary", 460800, 1563),
    ],
)
def test_the_data_rate_of_a_line_is_computed(form: str, baud_rate: int, rows: int) -> None:
    settings = amplifier(format=form, baud_rate=baud_rate)
    assert int(highest_rate_hz(settings, PROFILE, 0.008)) == rows
    require_line(amplifier(format=form, baud_rate=baud_rate, rate_hz=float(rows)), PROFILE, 0.008)


def test_trigger_edges_are_part_of_the_data_rate() -> None:
    quiet, triggered = amplifier(), amplifier(trigger=True)
    more = line_load(triggered, PROFILE, 0.008) - line_load(quiet, PROFILE, 0.008)
    assert more == pytest.approx(14 * 125 * 10 / 460800)


def test_a_stream_beyond_the_data_rate_is_refused_with_values_that_fit() -> None:
    ways = ("rate_hz 599", "baud_rate 921600", "format binary")
    with raises_code(ConfigError, "RID-AMPLIFIER-LINE-LOAD", "158 %", "460800 baud", *ways):
        require_line(amplifier(format="ascii"), PROFILE, 0.008)


def test_the_refusal_names_the_cell_file(tmp_path: Path) -> None:
    text = load_cell("ir361").files["cell.yaml"].decode()
    path = tmp_path / "cell.yaml"
    path.write_text(
        text[: text.find("\nplate:") + 1 or None]
        + "plate:\n  a_m: 0.12\n  b_m: 0.2\n  az0_m: -0.054\n  position_m: [0.0, 0.0, 0.0]\n"
        "  rotation_rad: [0.0, 0.0, 0.0]\n  amplifier:\n    address: /dev/ttyS0\n"
        "    baud_rate: 115200\n    rate_hz: 1000.0\n    low_pass_hz: 50.0\n"
        f"    range_n: {[5000.0] * 8}\n    sensitivity_pc_n: {[-7.5] * 8}\n"
    )
    with raises_code(
        ConfigError,
        "RID-AMPLIFIER-LINE-LOAD",
        f"{path}:{line_of(path, 'rate_hz')}:5:",
        "plate.amplifier.rate_hz:",
        "243 %",
    ):
        load_cell(str(path))
    path.write_text(path.read_text().replace("115200", "460800"))
    loaded = load_cell(str(path))
    assert loaded.amplifier_profile == PROFILE
    assert b"kistler_style" in loaded.files["amplifier.yaml"]
