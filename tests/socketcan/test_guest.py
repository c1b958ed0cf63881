"""Real SocketCAN on any machine: a user-mode-linux guest with vcan and slcan runs tests of its own.

The guest's files are the host's; it starts in two seconds and needs no privilege. Skipped where
user-mode-linux or can-utils are not installed (Debian: user-mode-linux can-utils busybox-static).
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
NEEDED = ("linux.uml", "busybox", "candump", "cansend", "slcand", "ip", "tc")
MISSING = [name for name in NEEDED if shutil.which(name) is None]
PATIENCE_S = 580

pytestmark = [
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}"),
    pytest.mark.timeout(PATIENCE_S + 20),
    pytest.mark.skipif(sys.platform != "linux", reason="user-mode-linux runs on Linux alone"),
]


def boot(folder: Path, *tests: str) -> str:
    """Run tests in the guest; return what it wrote."""
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(REPOSITORY),
        "HOME": "/tmp",
        "XDG_RUNTIME_DIR": "/tmp",
        "RID_DAQ_SOCKETCAN": "vcan0",
        "OPENBLAS_NUM_THREADS": "1",
        "COLUMNS": "100",
    }
    command = [
        *(sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-rA", "--color=no"),
        *("--basetemp=/tmp/pytest", "--durations=5", *tests),
    ]
    exports = "\n".join(f"export {name}={shlex.quote(text)}" for name, text in environment.items())
    (folder / "job.sh").write_text(
        f"cd {shlex.quote(str(REPOSITORY))}\n{exports}\n{shlex.join(command)} 2>&1\n"
    )
    guest = [
        *("linux.uml", "mem=1024M", "rootfstype=hostfs", "rootflags=/", "ro"),
        *("con=null", "con0=fd:0,fd:1", "con1=null", "ssl=null", f"uml_dir={folder}/"),
        *(f"init={HERE / 'guest_init.sh'}", f"FOLDER={folder}", f"REPOSITORY={REPOSITORY}"),
        *("quiet", "loglevel=1"),
    ]
    output = folder / "output.txt"
    with output.open("wb") as file:
        subprocess.run(
            guest, stdin=subprocess.DEVNULL, stdout=file, timeout=PATIENCE_S, check=False
        )
    return output.read_bytes().decode("utf-8", "replace").replace("\r", "")


def assert_passed(output: str) -> None:
    assert "GUEST-JOB-ENDED 0" in output, output[-8000:]
    assert re.search(r"\d+ passed", output), output[-4000:]
    assert "skipped" not in output.rsplit("passed", 1)[-1], output[-4000:]


@pytest.mark.fault(12)
def test_the_interface_and_drives_on_it(tmp_path: Path, measured: Callable[[str], None]) -> None:
    output = boot(tmp_path, "tests/socketcan/test_interface.py")
    assert_passed(output)
    figures = re.findall(r"^MEASURED (.*)$", output, re.MULTILINE)
    assert len(figures) == 3
    measured("; ".join(f"SocketCAN, {figure}" for figure in figures))


@pytest.mark.skipif(
    "RID_DAQ_SLOW" not in os.environ,
    reason="a minute of real time, to be run alone: set RID_DAQ_SLOW=1, as CI does",
)
def test_the_acceptance_suite(tmp_path: Path) -> None:
    assert_passed(boot(tmp_path, "tests/mock_hw/test_bus_acceptance.py", "-k", "socketcan"))
