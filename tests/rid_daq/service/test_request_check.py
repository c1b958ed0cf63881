from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import ConfigError
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.request_check import check_request, request_schemas, require_inside
from rid_daq.worker.job_requests import OWNED, request_of, request_schema, request_type

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)


@pytest.mark.parametrize("kind", list(JobKind))
def test_the_frozen_schemas_are_those_of_the_commands_requests(kind: JobKind) -> None:
    frozen = request_schemas()[kind.value]
    assert json.loads(json.dumps(request_schema(kind))) == frozen, (
        "run: .venv/bin/python docs/reference/api.py"
    )


@pytest.mark.parametrize("kind", list(JobKind))
def test_what_the_service_owns_is_nothing_that_a_client_can_say(kind: JobKind) -> None:
    assert not OWNED & set(request_schemas()[kind.value]["properties"])


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (JobKind.RECORD, {"motion": "motion.yaml", "simulation": {"pace": 2.0}}),
        (JobKind.IDENTIFY, {"names": ["latest"], "choose": True}),
        (JobKind.PAYLOAD, {"payload": "2kg", "limits": {"mass_percent": 2.0}, "periods": 5}),
        (JobKind.VALIDATE, {"model": "model.json", "run": "latest"}),
        (JobKind.EXPORT, {"what": "model.json", "to": "urdf", "output": "robot.urdf"}),
    ],
)
def test_what_the_schema_takes_is_a_request_of_the_command(
    kind: JobKind, told: dict[str, Any], tmp_path: Path
) -> None:
    check_request(kind, told, tmp_path)
    request = request_of(kind, told, "ir361", tmp_path, cleared=False)
    assert type(request) is request_type(kind)


@given(told=st.dictionaries(st.sampled_from(["motion", "until", "label", "x"]), JSON, max_size=3))
def test_whatever_a_client_says_is_a_request_or_refused(told: dict[str, Any]) -> None:
    try:
        check_request(JobKind.RECORD, told, Path("/tmp"))
    except ConfigError:
        return
    request_of(JobKind.RECORD, told, "ir361", Path("/tmp"), cleared=False)


@pytest.mark.parametrize("path", ["../x.yaml", "/etc/passwd", "a/../../x", "a\0b", "\ud800/x"])
def test_nothing_outside_the_folder_is_named(path: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="not inside the service's folder"):
        require_inside(path, tmp_path)


def test_a_link_that_leads_out_is_outside(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    with pytest.raises(ConfigError, match="not inside"):
        check_request(JobKind.RECORD, {"motion": "link/secret.yaml"}, folder)


def test_a_refusal_says_where(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"record: simulation.seed: 'a' is not of type"):
        check_request(JobKind.RECORD, {"motion": "m.yaml", "simulation": {"seed": "a"}}, tmp_path)
