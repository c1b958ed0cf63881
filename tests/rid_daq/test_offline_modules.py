"""Commands that need no bus load none of the modules that only some systems have."""

from __future__ import annotations

import subprocess
import sys

from rid_daq.operations.catalogue import operation

MISSING = ("fcntl", "termios", "resource", "tty", "pty")
OFFLINE = (
    *("compare", "design", "export", "friction", "identify", "import", "init", "payload identify"),
    *("report", "retime", "sensitivity", "validate"),
)


def test_offline_commands_and_the_api_load_no_module_of_unix_only() -> None:
    modules = {operation(name).module for name in OFFLINE} - {""} | {"rid_daq.api"}
    code = (
        f"import importlib, sys; sys.modules.update(dict.fromkeys({MISSING}));"
        "importlib.import_module('rid_daq.app');"
        f"[importlib.import_module(each) for each in {sorted(modules)}]"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
