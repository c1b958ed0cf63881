"""Commands that need no bus run on a system that is not Linux; the others refuse to run there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rid_daq.operations.catalogue import CATALOGUE, operation
from tests.builders.without_linux import hide_linux

OFFLINE = sorted(name for name in CATALOGUE if not operation(name).needs_linux)
NEED_LINUX = sorted(name for name in CATALOGUE if operation(name).needs_linux)
MAP = "--map ur10e_31 --runs runs"
FLOW = (
    f"import {{data}}/ur-20_02_12-50sec_12harm.csv {MAP} --rows 355-5090 --label a",
    f"import {{data}}/ur-20_01_17-ptp_10_points.csv {MAP} --rows 700-4200 --label b",
    "identify a -o model.json --runs runs",
    "validate model.json b --runs runs",
    "export model.json --to urdf -o arm.urdf",
    "compare a b --runs runs",
    "recover a --runs runs",
    "runs --verify --runs runs",
)
"""Commands of a person who identifies a robot from files."""


def without_linux(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a Python process in which functions of Linux are hidden."""
    hidden = f"from {hide_linux.__module__} import hide_linux; hide_linux(); {code}"
    return subprocess.run(
        [sys.executable, "-c", hidden, *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_every_operation_can_be_imported_without_the_modules_of_unix() -> None:
    modules = {operation(name).module for name in OFFLINE} - {""} | {"rid_daq.api", "rid_daq.app"}
    done = without_linux(
        f"import importlib; [importlib.import_module(each) for each in {sorted(modules)}];"
        "from rid_daq.operations.catalogue import CATALOGUE, operation;"
        "[operation(name) for name in CATALOGUE]"
    )
    assert done.returncode == 0, done.stderr


def test_commands_of_cells_say_that_they_need_linux() -> None:
    code = (
        "import sys; from pathlib import Path; from rid_daq.operations.catalogue import operation;"
        "from rid_daq.operations.perform import perform; from config.errors import ConfigError;"
    )
    assert {"record", "check", "serve", "stop", "demo"} <= set(NEED_LINUX)
    for name in NEED_LINUX:
        operation(name)
    loop = f"""
for name in {NEED_LINUX}:
    try:
        perform(operation(name), None, None)
    except ConfigError as error:
        print(name, error.refusal, sep=":")
"""
    done = without_linux(f"exec({code + loop!r})")
    assert done.stdout.splitlines() == [f"{name}:RID-SYSTEM-LINUX" for name in NEED_LINUX]


@pytest.mark.slow
def test_a_robot_is_identified_from_files_without_linux(real_robot: Path, tmp_path: Path) -> None:
    lines = [line.format(data=real_robot).split() for line in FLOW]
    done = without_linux(
        f"import os; os.chdir({str(tmp_path)!r}); from rid_daq.app import run;"
        f"print('codes', *[run(words) for words in {lines}])"
    )
    assert done.stdout.splitlines()[-1:] == ["codes" + " 0" * len(FLOW)], done.stdout + done.stderr
