"""Device type of a data sheet, and its missing objects that matter for safety."""

from __future__ import annotations

import pytest

from benchmarks.data_sheets import kind_of
from config.cell.cell import CellConfig
from config.formats.eds import ElectronicDataSheet, parse_eds
from drivers.data_sheets.eds_fit import EdsFit, fit_eds
from tests.drivers.data_sheets.test_eds_check import COMMUNICATION, PROFILE

SERVO, STEPPER, SEVERAL = "0x20192", "0x40192", "0xFFFF0192"
MAKERS = {"2000": "6 rw 0"}
WITHOUT_TORQUE = {"6072": None, "6076": None, "6077": None}


def sheet(objects: dict[str, str | None], device_type: str = "") -> ElectronicDataSheet:
    """Return a small complete sheet with some objects changed or removed (None)."""
    lines = ["[DeviceInfo]", "VendorNumber=1"]
    for title, entry in (COMMUNICATION | PROFILE | objects).items():
        if entry is not None:
            data_type, access, mapping, *name = entry.split(maxsplit=3)
            lines += [f"[{title}]", f"DataType={data_type}", f"AccessType={access}"]
            lines += [f"PDOMapping={mapping}", f"ParameterName={(*name, title)[0]}"]
            lines += [f"DefaultValue={device_type}"] * (title == "1000" and device_type != "")
    return parse_eds("\n".join(lines).encode(), "drive.eds")


@pytest.mark.parametrize(
    ("objects", "device_type", "kind"),
    [
        (MAKERS, SERVO, "servo drive"),
        (MAKERS, "", "servo drive"),
        (MAKERS | WITHOUT_TORQUE, SERVO, "servo drive"),
        (MAKERS | WITHOUT_TORQUE, STEPPER, "stepper or without torque"),
        (MAKERS | WITHOUT_TORQUE, SEVERAL, "stepper or without torque"),
        (MAKERS | WITHOUT_TORQUE | {"2030": "3 ro 1 Actual current"}, SEVERAL, "servo drive"),
        ({}, SERVO, "sample or simulated"),
        (MAKERS | {"6040": None}, SERVO, "other device"),
        (MAKERS, "0x191", "servo drive"),
        (MAKERS | {"6060": None}, "0x191", "other device"),
    ],
)
def test_a_sheet_states_its_device_type(
    objects: dict[str, str | None], device_type: str, kind: str
) -> None:
    assert kind_of(sheet(objects, device_type)) == kind


def fit_and_missing(
    cell: CellConfig, objects: dict[str, str | None]
) -> tuple[EdsFit, dict[str, bool]]:
    """Return the fit of a sheet, and for each missing object True if the object matters for
    people's safety.
    """
    fit = fit_eds(sheet(objects), cell, cell.axes[0], {})
    return fit, {each.object_name: fit.protects(each) for each in fit.findings}


def test_the_heartbeat_consumer_protects_people_and_an_answer_does_not(
    cell: CellConfig,
) -> None:
    fit, missing = fit_and_missing(cell, {"1016sub1": None, "6041": "6 ro 0"})
    assert missing == {"1016h:01": True, "6041h:00": True}
    fit, missing = fit_and_missing(cell, {"1016sub1": None, "100C": "6 rw 0"})
    assert missing == {"1016h:01": True}
    fit, missing = fit_and_missing(cell, {"6064": "4 ro 0"})
    assert missing == {"6064h:00": False}
    assert not fit.concerns_safety


def test_life_guarding_replaces_the_heartbeat_consumer(cell: CellConfig) -> None:
    guarding: dict[str, str | None] = {"100C": "6 rw 0", "100D": "5 rw 0"}
    fit, missing = fit_and_missing(cell, {"1016sub1": None, "1017": None, **guarding})
    assert missing == {}
    assert fit.keys == {"watch": "life_guarding"}
    fit, missing = fit_and_missing(cell, {"1016sub1": None, **guarding, "100D": "5 const 0"})
    assert missing == {"100Dh:00": True}


def test_a_read_only_object_may_have_another_size(cell: CellConfig) -> None:
    assert fit_and_missing(cell, {"60B2": "4 ro 1"})[0].accepted


def test_the_profile_deceleration_protects_nobody(cell: CellConfig) -> None:
    ramp = {"6083": "7 rw 0", "6084": "7 ro 0", "60C2sub1": None, "60C2sub2": None}
    fit, missing = fit_and_missing(cell, ramp)
    assert fit.mode == "profile_velocity"
    assert missing == {"6084h:00": False}
