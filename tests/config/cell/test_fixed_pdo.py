"""PDOs with a fixed mapping: what a drive profile can state about them."""

from __future__ import annotations

from typing import Any

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.errors import ConfigError
from config.load import load_bundled_or_path, load_cell
from tests.builders.raised_codes import raises_code, raises_invalid


def entry(name: str, bits: int, **more: Any) -> dict[str, Any]:
    return {"object": name, "bits": bits, **more}


def pdo(name: str, *objects: dict[str, Any], transmission: int = 1) -> dict[str, Any]:
    return {"pdo": name, "transmission": transmission, "objects": objects}


WORD = entry("6040h:00", 16, signal="controlword")
TARGET = entry("60FFh:00", 32, signal="target")
STATUS = entry("6041h:00", 16, signal="statusword")
POSITION = entry("6064h:00", 32, signal="position")
TORQUE = entry("6077h:00", 16, signal="torque")
GOOD = (pdo("rpdo1", WORD, TARGET), pdo("tpdo1", STATUS, POSITION, TORQUE))


def test_a_profile_with_all_signals_once_is_accepted() -> None:
    profile = ServoProfile.model_validate({"pdos": GOOD})
    assert profile.spread
    assert profile.pdos[0].signals == ("controlword", "target")


@pytest.mark.parametrize(
    ("pdos", "key", "details"),
    [
        ((GOOD[0],), "", ("statusword, position, torque",)),
        ((*GOOD, GOOD[0]), "", ("names a PDO",)),
        ((pdo("rpdo1", WORD, TARGET), pdo("tpdo1", WORD)), "pdos.1", ("tpdo1", "controlword")),
        (
            (pdo("rpdo1", WORD, TARGET, entry("2301h:01", 8)), GOOD[1]),
            "pdos.0",
            ("rpdo1: 2301h:01",),
        ),
        (
            (pdo("rpdo1", WORD, TARGET, entry("2301h:01", 8, holds=256)), GOOD[1]),
            "pdos.0",
            ("rpdo1: holds 256", "8 bits"),
        ),
        (
            (GOOD[0], pdo("tpdo1", STATUS, POSITION, TORQUE, transmission=253)),
            "pdos.1",
            ("tpdo1: transmission 253",),
        ),
        (
            (GOOD[0], pdo("tpdo1", STATUS, entry("6064h:00", 16, signal="position"))),
            "pdos.1",
            ("tpdo1: position", "16 bits"),
        ),
        (
            (pdo("rpdo1", *[entry(f"2000h:0{n}", 32) for n in (1, 2, 3)]), *GOOD),
            "pdos.0",
            ("rpdo1: ", "64 bits"),
        ),
        (
            (GOOD[0], pdo("tpdo1", STATUS, POSITION, TORQUE | {"object": "6078h:00"})),
            "",
            ("6077h:00",),
        ),
    ],
)
def test_an_unusable_mapping_is_refused(
    pdos: tuple[dict[str, Any], ...], key: str, details: tuple[str, ...]
) -> None:
    with raises_invalid(key, *details):
        ServoProfile.model_validate({"pdos": pdos})


def test_a_manufacturer_specific_mode_needs_pdos() -> None:
    with raises_invalid("", "needs pdos"):
        ServoProfile(mode="makers")


@pytest.mark.parametrize("name", ["faulhaber_mc3000", "trinamic_tmcm16xx"])
def test_the_trimmed_exchange_needs_mappable_pdos(name: str) -> None:
    cell: CellConfig = load_cell("ir361").config
    profile = load_bundled_or_path(name, "servos", ServoProfile)
    trimmed = cell.model_copy(update={"servo": profile, "exchange": "trimmed"})
    with raises_code(ConfigError, "RID-CELL-VALUE", "axis1"):
        trimmed.servo_of(trimmed.axes[0])
