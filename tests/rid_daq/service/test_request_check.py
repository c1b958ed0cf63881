from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ConfigError
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import check_request, parse_request, require_inside
from tests.builders.raised_codes import raises_code

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)


@pytest.mark.parametrize(
    ("kind", "document"),
    [
        (JobKind("record"), {"motion": "motion.yaml", "simulation": {"pace": 2.0}}),
        (JobKind("identify"), {"names": ["latest"], "choose": True}),
        (
            JobKind("payload_session"),
            {"payload": "2kg", "limits": {"mass_percent": 2.0}, "periods": 5},
        ),
        (JobKind("design"), {"output": "motion.yaml", "excitation": {"wanted": ["m1", "sx2"]}}),
        (JobKind("validate"), {"model": "model.json", "run": "latest"}),
        (JobKind("export"), {"what": "model.json", "to": "urdf", "output": "robot.urdf"}),
    ],
)
def test_a_valid_request_becomes_the_request_of_its_command(
    kind: JobKind, document: dict[str, Any], tmp_path: Path
) -> None:
    check_request(kind, document, tmp_path)
    request = parse_request(kind, document, cell="ir361", runs=str(tmp_path), cleared=False)
    assert type(request) is kind.operation.request


@pytest.mark.parametrize(
    ("kind", "document", "key", "value"),
    [
        (
            JobKind("payload_identify"),
            {"loaded": ["b"], "unloaded": ["a"], "limits": {"centre_mm": 1e4}},
            "limits.centre_mm",
            "10000 mm",
        ),
        (
            JobKind("payload_identify"),
            {"loaded": ["b"], "unloaded": ["a"], "torque_constant_sigma": 1.0},
            "torque_constant_sigma",
            "1",
        ),
        (
            JobKind("identify"),
            {"names": ["latest"], "load_mass_kg": [2805.0, 0.01]},
            "load_mass_kg.0",
            "2.805 kg",
        ),
        (
            JobKind("identify"),
            {"names": ["latest"], "how": {"options": {"band_hz": 1e4}}},
            "band_hz",
            "10000 Hz",
        ),
        (
            JobKind("validate"),
            {"model": "m.json", "run": "latest", "mass_kg": 2e5},
            "mass_kg",
            "200000 kg",
        ),
        (
            JobKind("payload_session"),
            {"until_mass_kg": 50.0},
            "until_mass_kg",
            "50 kg",
        ),
        (
            JobKind("payload_session"),
            {"warm_up_percent": 1e-3},
            "warm_up_percent",
            "0.001 %",
        ),
    ],
)
def test_the_service_refuses_implausible_values_like_the_command(
    kind: JobKind, document: dict[str, Any], key: str, value: str, tmp_path: Path
) -> None:
    with raises_code(ConfigError, "RID-OPTION-RANGE", key, value):
        checked_and_read(kind, document, tmp_path)


def checked_and_read(kind: JobKind, document: dict[str, Any], folder: Path) -> object:
    """Check a request like the service, and return it as the worker parses it."""
    check_request(kind, document, folder)
    return parse_request(kind, document, cell="ir361", runs=str(folder), cleared=False)


@pytest.mark.parametrize(
    "name", ["mass_percent", "mass_kg", "centre_mm", "inertia_kg_m2", "residual_nm"]
)
def test_a_limit_below_zero_is_refused_at_once(name: str, tmp_path: Path) -> None:
    document = {"loaded": ["b"], "unloaded": ["a"], "limits": {name: -5.0}}
    with raises_code(ConfigError, "RID-OPTION-RANGE", f"payload_identify: limits.{name}: -5.0 "):
        check_request(JobKind("payload_identify"), document, tmp_path)


@given(
    document=st.dictionaries(st.sampled_from(["motion", "until", "label", "x"]), JSON, max_size=3)
)
def test_a_random_request_is_accepted_or_refused_without_another_error(
    document: dict[str, Any],
) -> None:
    try:
        check_request(JobKind("record"), document, Path("/tmp"))
    except ConfigError:
        return
    parse_request(JobKind("record"), document, cell="ir361", runs="/tmp", cleared=False)


@pytest.mark.parametrize("path", ["../x.yaml", "/etc/passwd", "a/../../x", "a\0b", "\ud800/x"])
def test_a_path_outside_the_folder_is_refused(path: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as refused:
        require_inside(path, tmp_path)
    assert refused.value.refusal in ("RID-PATH-OUTSIDE", "RID-PATH-NAME")


def test_a_link_that_points_outside_the_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    with raises_code(ConfigError, "RID-PATH-OUTSIDE"):
        check_request(JobKind("record"), {"motion": "link/secret.yaml"}, folder)


def test_a_lone_surrogate_is_refused_with_its_key(tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-REQ-TEXT", "label", "\\ud800"):
        check_request(JobKind("record"), {"motion": "m.yaml", "label": "\ud800"}, tmp_path)


def test_a_refusal_names_the_field(tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-REQUEST-INVALID", "record", "simulation.seed", "'a'"):
        check_request(
            JobKind("record"), {"motion": "m.yaml", "simulation": {"seed": "a"}}, tmp_path
        )
