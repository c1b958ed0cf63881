"""Load data of every controller: golden files computed by hand, and round trips."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import numpy as np
import pytest
import yaml

from config.errors import ConfigError, EstimationError
from identification.choices import LoadFormat
from identification.payload.body import PayloadBody
from identification.payload.controllers.formats import (
    deviation,
    load_data,
    read_load_data,
    rounding,
)
from identification.payload.controllers.text import number_writer
from tests.builders.raised_codes import raises_code

# A body whose values are computed by hand: mass 4 kg, centre of gravity at (10, -20, 100) mm,
# principal moments 0.03, 0.05 and 0.06 kg m^2. The principal axes are the flange's axes, turned by
# +30 degrees about z. With cos^2 30 = 3/4, sin^2 30 = 1/4, sin 30 cos 30 = sqrt(3)/4:
#   Ixx = 0.03 * 3/4 + 0.05 * 1/4 = 0.035
#   Iyy = 0.03 * 1/4 + 0.05 * 3/4 = 0.045
#   Ixy = (0.03 - 0.05) * sqrt(3)/4 = -0.00866025403784   (axis of the small moment: +x +y)
#   Izz = 0.06, Ixz = Iyz = 0
TURNED_ABOUT_Z = PayloadBody.of_reported(
    np.array([4.0, 0.01, -0.02, 0.1, 0.035, 0.045, 0.06, -0.02 * np.sqrt(3.0) / 4.0, 0.0, 0.0])
)


def last_lines(text: str, mark: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith(mark)]


def test_kuka_load_data_agree_with_values_by_hand() -> None:
    # Lengths in mm; A is the rotation about z: 30 degrees; J are the principal moments by axis.
    text = load_data(TURNED_ABOUT_Z, LoadFormat.KUKA)
    assert last_lines(text, ";") == [
        "LOAD_DATA[1]={M 4,CM {X 10,Y -20,Z 100,A 30,B 0,C 0},J {X 0.03,Y 0.05,Z 0.06}}"
    ]
    assert "CM X, Y, Z [mm]" in text
    assert "A, B, C [deg]" in text


def test_kuka_rotates_b_about_y_and_c_about_x() -> None:
    # Principal axes turned by +20 degrees about y: x' = (cos, 0, -sin), z' = (sin, 0, cos), so
    #   Ixz = 0.03 * cos * (-sin) + 0.06 * sin * cos = 0.03 sin 20 cos 20 = 0.015 sin 40.
    sin2, s, c = np.sin(np.radians(40.0)), np.sin(np.radians(20.0)), np.cos(np.radians(20.0))
    about_y = PayloadBody.of_reported(
        np.array(
            [
                4.0,
                0.0,
                0.0,
                0.0,
                0.03 * c * c + 0.06 * s * s,
                0.05,
                0.03 * s * s + 0.06 * c * c,
                0.0,
                0.015 * sin2,
                0.0,
            ]
        )
    )
    assert "A 0,B 20,C 0},J {X 0.03,Y 0.05,Z 0.06}}" in load_data(about_y, LoadFormat.KUKA)
    # Principal axes turned by +20 degrees about x: y' = (0, cos, sin), z' = (0, -sin, cos), so
    #   Iyz = 0.05 * cos * sin - 0.06 * sin * cos = -0.005 sin 40.
    about_x = PayloadBody.of_reported(
        np.array(
            [
                4.0,
                0.0,
                0.0,
                0.0,
                0.03,
                0.05 * c * c + 0.06 * s * s,
                0.05 * s * s + 0.06 * c * c,
                0.0,
                0.0,
                -0.005 * sin2,
            ]
        )
    )
    assert "A 0,B 0,C 20},J {X 0.03,Y 0.05,Z 0.06}}" in load_data(about_x, LoadFormat.KUKA)


def test_abb_loaddata_agrees_with_values_by_hand() -> None:
    # A turn of 30 degrees about z is the quaternion [cos 15, 0, 0, sin 15], scalar first:
    # cos 15 = 0.965925826289, sin 15 = 0.258819045103.
    text = load_data(TURNED_ABOUT_Z, LoadFormat.ABB)
    assert last_lines(text, "!") == [
        "PERS loaddata load1:=[4,[10,-20,100],[0.965925826289,0,0,0.258819045103],0.03,0.05,0.06];"
    ]
    assert "tool0" in text
    assert "[mm]" in text


def test_a_fanuc_schedule_agrees_with_values_by_hand() -> None:
    # Centre in cm: 1, -2, 10. One kgf cm s^2 is 9.80665 * 0.01 = 0.0980665 kg m^2:
    # 0.035 / 0.0980665 = 0.356900674, 0.045 / 0.0980665 = 0.458872296, 0.06 / ... = 0.611829728.
    text = load_data(TURNED_ABOUT_Z, LoadFormat.FANUC)
    rows = [line.rsplit(maxsplit=1) for line in last_lines(text, "#")]
    assert [name.strip() for name, _ in rows] == [
        "PAYLOAD [kg]",
        "PAYLOAD CENTER X [cm]",
        "PAYLOAD CENTER Y [cm]",
        "PAYLOAD CENTER Z [cm]",
        "PAYLOAD INERTIA X [kgfcms^2]",
        "PAYLOAD INERTIA Y [kgfcms^2]",
        "PAYLOAD INERTIA Z [kgfcms^2]",
    ]
    assert [float(value) for _, value in rows] == pytest.approx(
        [4.0, 1.0, -2.0, 10.0, 0.356900674, 0.458872296, 0.611829728], rel=3e-9
    )
    # Values for which the schedule has no field are reported.
    assert "-0.00866025403784" in text
    assert "left out" in text


def test_a_universal_robots_call_agrees_with_values_by_hand() -> None:
    # The order is Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity; units m and kg m^2.
    text = load_data(TURNED_ABOUT_Z, LoadFormat.UR)
    assert last_lines(text, "#") == [
        "set_target_payload(4, [0.01, -0.02, 0.1],"
        " [0.035, 0.045, 0.06, -0.00866025403784, 0, 0], 0.1)"
    ]


def test_a_request_of_the_ur_driver_agrees_with_values_by_hand() -> None:
    request = yaml.safe_load(load_data(TURNED_ABOUT_Z, LoadFormat.UR_ROS2))
    assert request == {
        "mass": 4,
        "center_of_gravity": {"x": 0.01, "y": -0.02, "z": 0.1},
        "ixx": 0.035,
        "iyy": 0.045,
        "izz": 0.06,
        "ixy": -0.00866025403784,
        "ixz": 0,
        "iyz": 0,
        "transition_time": {"sec": 0, "nanosec": 100_000_000},
    }


def test_franka_values_are_column_major() -> None:
    text = load_data(TURNED_ABOUT_Z, LoadFormat.FRANKA)
    document = json.loads(text)
    assert document["load_mass"] == 4.0
    assert document["F_x_Cload"] == [0.01, -0.02, 0.1]
    ixy = -0.00866025403784
    assert document["load_inertia"] == [0.035, ixy, 0.0, ixy, 0.045, 0.0, 0.0, 0.0, 0.06]


def test_a_staubli_table_agrees_with_values_by_hand() -> None:
    text = load_data(TURNED_ABOUT_Z, LoadFormat.STAUBLI)
    assert "NOT VERIFIED with a controller" in text
    assert last_lines(text, "//") == [
        "mass_kg = 4",
        "x_mm = 10",
        "y_mm = -20",
        "z_mm = 100",
        "Ixx_kg_m2 = 0.035",
        "Iyy_kg_m2 = 0.045",
        "Izz_kg_m2 = 0.06",
        "Ixy_kg_m2 = -0.00866025403784",
        "Ixz_kg_m2 = 0",
        "Iyz_kg_m2 = 0",
    ]


def test_a_urdf_link_agrees_with_values_by_hand() -> None:
    text = load_data(TURNED_ABOUT_Z, LoadFormat.URDF)
    assert '<origin xyz="0.01 -0.02 0.1" rpy="0 0 0"/>' in text
    assert '<mass value="4"/>' in text
    assert (
        '<inertia ixx="0.035" ixy="-0.00866025403784" ixz="0" iyy="0.045" iyz="0" izz="0.06"/>'
        in text
    )


def random_body(seed: int) -> PayloadBody:
    """Return a physically possible body: a ball, a cylinder, or six point masses."""
    random = np.random.default_rng(seed)
    kind = seed % 4
    if kind == 0:  # a ball: all moments equal
        inertia = np.eye(3) * random.uniform(0.01, 1.0)
    elif kind == 1:  # a cylinder in any direction
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        across, along = 0.2, 0.35 * random.uniform(0.1, 1.0)
        inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    else:
        points = random.normal(scale=0.1, size=(6, 3))
        points -= points.mean(axis=0)
        second = points.T @ points * random.uniform(0.1, 3.0)
        inertia = np.trace(second) * np.eye(3) - second
    return PayloadBody(
        float(random.uniform(0.05, 300.0)), random.uniform(-0.5, 0.5, 3), (inertia + inertia.T) / 2
    )


@pytest.mark.fault(34)
@pytest.mark.parametrize("form", LoadFormat)
def test_a_thousand_bodies_are_read_back_as_written(
    form: LoadFormat, measured: Callable[[str], None]
) -> None:
    worst = 0.0
    for seed in range(1000):
        body = random_body(seed)
        worst = max(worst, deviation(body, read_load_data(load_data(body, form), form), form))
    assert worst < 2e-9
    measured("1000 bodies are read back unchanged")


@pytest.mark.parametrize("form", LoadFormat)
def test_a_changed_digit_is_detected(form: LoadFormat) -> None:
    text = load_data(TURNED_ABOUT_Z, form)
    changed = text.replace("0.035", "0.0351").replace("0.03,", "0.0301,").replace("0.3569", "0.36")
    assert changed != text
    assert deviation(TURNED_ABOUT_Z, read_load_data(changed, form), form) > 1e-4


@pytest.mark.parametrize("form", LoadFormat)
def test_text_that_is_not_load_data_is_refused(form: LoadFormat) -> None:
    for text in ("", "hello", "{}", "[1, 2, 3]", "<robot/>"):
        with raises_code(ConfigError, "RID-LOAD-DATA-FORMAT", form.value):
            read_load_data(text, form)
    with raises_code(ConfigError, "RID-FILE-SIZE"):
        read_load_data("x" * 2_000_000, form)


@pytest.mark.fault(33)
@pytest.mark.parametrize("form", LoadFormat)
def test_an_impossible_body_is_not_written(
    form: LoadFormat, measured: Callable[[str], None]
) -> None:
    # One moment of inertia is larger than the sum of the other two.
    with raises_code(EstimationError, "RID-PAYLOAD-IMPOSSIBLE"):
        load_data(PayloadBody(1.0, np.zeros(3), np.diag([0.1, 0.1, 0.3])), form)
    with raises_code(EstimationError, "RID-PAYLOAD-IMPOSSIBLE"):
        load_data(PayloadBody(-1.0, np.zeros(3), np.diag([0.1, 0.1, 0.1])), form)
    measured("refused: negative mass, inertias that violate the triangle inequality")


def test_an_inertia_beyond_the_controllers_limit_is_refused() -> None:
    heavy = PayloadBody(900.0, np.zeros(3), np.diag([140.0, 140.0, 140.0]))
    with raises_code(EstimationError, "RID-LOAD-DATA-RANGE", "140 kg", "133 kg"):
        load_data(heavy, LoadFormat.UR)
    with raises_code(EstimationError, "RID-LOAD-DATA-RANGE"):
        load_data(heavy, LoadFormat.UR_ROS2)


def test_origin_lines_cannot_leave_their_comment() -> None:
    origin = ("run 1\nset_target_payload(99, [0,0,0], [1,1,1,0,0,0], 0)",)
    text = load_data(TURNED_ABOUT_Z, LoadFormat.UR, origin)
    assert read_load_data(text, LoadFormat.UR).mass_kg == 4.0
    assert load_data(TURNED_ABOUT_Z, LoadFormat.URDF, ("a --> b",)).count("-->") == 1


@pytest.mark.parametrize("form", LoadFormat)
def test_only_the_known_digits_are_written(form: LoadFormat) -> None:
    body = PayloadBody(
        9.608412345678,
        np.array([0.0239051234, 0.0898012345, -0.202841234]),
        np.diag([2.1234567, 2.5, 3.4567891]),
    )
    sigma = np.array([0.06, *[0.0006] * 3, *[0.05] * 6])
    sure = rounding(body, sigma)
    assert sure == pytest.approx(0.05 * 2.0 * 0.0006 / float(np.linalg.norm(body.centre_m)))
    text = load_data(body, form, (), sure)
    found = read_load_data(text, form)
    assert deviation(body, found, form) <= sure
    assert found.is_consistent
    values = re.findall(r"\d[\d.]*\d", text.split("9.6", 1)[1])  # from the mass on
    assert all(len(each.replace(".", "").lstrip("0")) <= 5 for each in values), values
    assert len(load_data(body, form)) > len(text)


def test_weighed_values_keep_all_their_digits() -> None:
    body = PayloadBody(2.80512345, np.zeros(3), np.diag([0.01, 0.011, 0.012]))
    assert rounding(body, np.zeros(10)) == 0.0
    assert "M 2.80512345," in load_data(body, LoadFormat.KUKA, (), 0.0)


@pytest.mark.parametrize(
    ("value", "count", "text"),
    [
        (1.23456e-5, 3, "0.0000123"),
        (-123456.0, 3, "-123000"),
        (-1e-20, 4, "0"),
        (9.6084, 3, "9.61"),
    ],
)
def test_values_for_a_teach_pendant_have_no_exponent(value: float, count: int, text: str) -> None:
    assert number_writer(count)(value) == text
