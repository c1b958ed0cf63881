"""Tests with real SocketCAN and a failing disk, in a user-mode-linux guest, on any computer.

The guest uses the host's files; it starts in two seconds and needs no privilege. Two guests run at
the same time, because each uses one core. The tests are skipped if a tool is missing (Debian:
user-mode-linux can-utils busybox-static iproute2 dmsetup e2fsprogs).
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
NEEDED = ["linux.uml", "busybox", "candump", "cansend", "slcand", "ip", "tc", "dmsetup", "mke2fs"]
MISSING = [name for name in NEEDED if shutil.which(name) is None]
CANOPEND = os.environ.get("RID_DAQ_CANOPEND") or shutil.which("canopend") or ""
PATIENCE_S = 860
GUESTS: dict[str, tuple[str, ...]] = {
    "interface_output": ("tests/socketcan/test_interface.py", "tests/faults/test_failing_disk.py"),
    "acceptance_output": ("tests/mock_hw/test_bus_acceptance.py", "-k", "socketcan"),
}
"""Tests that run in each guest; the keys are the names of the fixtures that return the output."""
if CANOPEND:
    GUESTS["canopennode_output"] = ("tests/socketcan/test_canopennode.py",)

pytestmark = [
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}"),
    pytest.mark.timeout(PATIENCE_S + 20),
]


def boot(folder: Path, *tests: str) -> str:
    """Run tests in the guest; return their output."""
    if CANOPEND:  # the guest has its own /tmp
        shutil.copy(CANOPEND, folder / "canopend")
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(REPOSITORY),
        "HOME": "/tmp",
        "XDG_RUNTIME_DIR": "/tmp",
        "RID_DAQ_SOCKETCAN": "vcan0",
        "OPENBLAS_NUM_THREADS": "1",
        "COLUMNS": "100",
        "RID_DAQ_CANOPEND": CANOPEND and str(folder / "canopend"),
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


@pytest.fixture(scope="module")
def outputs(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, Future[str]]]:
    """Run the guests of all selected tests, two at the same time; yield their outputs."""
    items = [item for item in request.session.items if isinstance(item, pytest.Function)]
    used = {name for item in items for name in item.fixturenames} & GUESTS.keys()
    with ThreadPoolExecutor(2) as pool:
        yield {
            name: pool.submit(boot, tmp_path_factory.mktemp("guest"), *GUESTS[name])
            for name in sorted(used)
        }


@pytest.fixture(scope="module")
def interface_output(outputs: dict[str, Future[str]]) -> str:
    return outputs["interface_output"].result()


@pytest.fixture(scope="module")
def canopennode_output(outputs: dict[str, Future[str]]) -> str:
    return outputs["canopennode_output"].result()


@pytest.fixture(scope="module")
def acceptance_output(outputs: dict[str, Future[str]]) -> str:
    return outputs["acceptance_output"].result()


@pytest.fixture(scope="module")
def figures(interface_output: str) -> dict[str, str]:
    """Return the result that each test of a fault printed in the guest."""
    assert_passed(interface_output)
    figures = dict(re.findall(r"^MEASURED (.*?): (.*)$", interface_output, re.MULTILINE))
    assert len(figures) == 5
    return figures


@pytest.mark.alone
@pytest.mark.fault(12)
def test_the_tests_of_interface_and_drives_pass_in_the_guest(
    figures: dict[str, str], measured: Callable[[str], None]
) -> None:
    for fault in ("full queue", "bus-off", "interface down"):
        measured(f"SocketCAN, {fault}: {figures[fault]}")


@pytest.mark.alone
@pytest.mark.fault(26)
def test_the_kernels_time_stamps_are_usable_while_the_date_is_set(
    figures: dict[str, str], measured: Callable[[str], None]
) -> None:
    measured(f"SocketCAN, date set in motion: {figures['date set in motion']}")


@pytest.mark.alone
@pytest.mark.fault(24)
def test_the_tests_of_a_failing_disk_pass_in_the_guest(
    figures: dict[str, str], measured: Callable[[str], None]
) -> None:
    measured(f"EIO of a block device that dies: {figures['failing disk']}")


@pytest.mark.alone
@pytest.mark.skipif(not CANOPEND, reason="canopend (CANopenNode for Linux) is not installed")
def test_canopennode_works_as_a_device_and_as_a_master(canopennode_output: str) -> None:
    assert_passed(canopennode_output)


@pytest.mark.alone
@pytest.mark.long
def test_the_acceptance_suite_passes_in_the_guest(acceptance_output: str) -> None:
    assert_passed(acceptance_output)
