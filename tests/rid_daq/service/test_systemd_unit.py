from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from config.errors import ConfigError
from rid_daq.app import run
from rid_daq.service.systemd_unit import SystemdUnit
from tests.builders.console_blocks import assert_shown
from tests.builders.raised_codes import raises_code


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.delenv("INVOCATION_ID", raising=False)
    return tmp_path / "config" / "systemd" / "user"


def unit(folder: Path, cell: str = "ir361") -> SystemdUnit:
    return SystemdUnit.of([cell], folder, [cell, "--folder", str(folder)])


def test_install_writes_a_unit_with_the_same_options(
    tmp_path: Path, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "cell four"
    folder.mkdir()
    assert run(["serve", "ir361", "--folder", str(folder), "--pace", "5", "--install"]) == 0
    output = capsys.readouterr().out
    assert_shown("run-the-service", "rid-daq serve cell.yaml --install", output)
    text = (home / "rid-daq.service").read_text()
    lines = dict(line.split("=", 1) for line in text.splitlines() if "=" in line)
    words = shlex.split(lines["ExecStart"])
    assert words[1:5] == ["-P", "-m", "rid_daq", "serve"]
    assert words[5:] == [
        *("ir361", "--folder", str(folder), "--listen", "127.0.0.1:8642", "--pace", "5"),
    ]
    assert lines["KillMode"] == "mixed", "the service ends its workers itself"


def test_a_foreign_unit_is_not_changed(tmp_path: Path, home: Path) -> None:
    home.mkdir(parents=True)
    (home / "rid-daq.service").write_text("[Service]\nExecStart=/bin/true\n")
    with raises_code(ConfigError, "RID-FILE-EXISTS"):
        unit(tmp_path).install()


def test_an_older_unit_is_updated_if_systemd_started_it(
    tmp_path: Path, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit(tmp_path, "kr15").install()
    newer = unit(tmp_path)
    assert not newer.keep_current(), "a service started in a terminal does not change the unit"
    monkeypatch.setenv("INVOCATION_ID", "1")
    assert newer.keep_current()
    assert (home / "rid-daq.service").read_text() == newer.text
    assert not newer.keep_current()


def test_percent_signs_are_escaped(tmp_path: Path) -> None:
    folder = tmp_path / "100%"
    folder.mkdir()
    assert "100%%" in unit(folder).text
