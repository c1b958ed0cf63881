"""Oversized, unusual and damaged files; too little memory, disk space, files or processes."""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.session.helper_process import HelperProcess, start_all
from config.errors import ShortageError
from config.formats.bounded_file import read_file
from config.process.shortage import as_shortage, named_error, require_memory
from rid_daq.app import run
from tests.builders.invented import whole_result
from tests.builders.raised_codes import raises_code

GIGABYTE = 1 << 30
LITTLE = 200 << 20  # bytes: a command with all its imports, and no file


@pytest.fixture
def unusual_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with huge sparse files, a named pipe, a folder and a circular link."""
    monkeypatch.chdir(tmp_path)
    for name in ("big.yaml", "big.json", "big.csv", "big.urdf", "big.mcap"):
        with open(name, "wb") as file:
            file.truncate(5 * GIGABYTE)
    os.mkfifo("pipe.yaml")
    Path("folder.yaml").mkdir()
    Path("loop.yaml").symlink_to("loop.yaml")
    folder = RunFolder.create(tmp_path / "runs", "big")
    with folder.file("result.json").open("wb") as file:
        file.truncate(GIGABYTE)
    return tmp_path


@pytest.mark.fault(50)
@pytest.mark.parametrize(
    "words",
    [
        "check big.yaml", "record ir361 big.yaml", "record ir361 big.yaml --faults big.yaml",
        "import big.csv --map ur10e_31", "import big.csv --map big.yaml",
        "init new --urdf big.urdf",
        "validate big.json big", "export big.json --to urdf -o a.urdf", "compare big.json big.json",
        "report big", "recover big.mcap", "payload read-back big.json big.json --from urdf",
        "compensate ir361 big.yaml --model big.json --loop big.json -o a.json",
    ],
)  # fmt: skip
def test_an_oversized_file_is_refused_before_it_is_read(
    words: str,
    unusual_files: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    run(["--help"])
    tracemalloc.start()
    try:
        code = run(words.split())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    message = capsys.readouterr().err
    assert code in (2, 7), message
    assert "larger" in message
    assert peak < LITTLE
    measured("a file of 5 GB is refused before it is read")


@pytest.mark.fault(50)
@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("pipe.yaml", errno.EINVAL),
        ("folder.yaml", errno.EINVAL),
        ("loop.yaml", errno.ELOOP),
        ("/dev/zero", errno.EINVAL),
        ("big.yaml", errno.EFBIG),
        ("a\0b.yaml", errno.EINVAL),
    ],
)
def test_a_path_that_is_not_a_regular_file_is_refused_without_waiting(
    name: str, number: int, unusual_files: Path
) -> None:
    assert errno_of(Path(name), 1_000_000) == number


def errno_of(path: Path, most_bytes: int) -> int | None:
    with pytest.raises(OSError) as caught:  # noqa: PT011  the caller checks its errno
        read_file(path, most_bytes)
    return caught.value.errno


def test_a_file_that_has_grown_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "grows"
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with path.open("ab") as file:
        file.write(b"6")
    assert errno_of(path, 5) == errno.EFBIG


def run_with_limit(
    words: list[str], folder: Path, limit: int, size: int
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rid_daq", *words],
        cwd=folder,
        preexec_fn=lambda: resource.setrlimit(limit, (size, size)),
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.fault(50)
@pytest.mark.parametrize(
    ("words", "limit", "size", "expected"),
    [
        ("identify latest", resource.RLIMIT_AS, 700_000_000, "not enough memory"),
        ("record ir361 m.yaml", resource.RLIMIT_AS, 300_000_000, "not enough memory"),
        ("demo", resource.RLIMIT_AS, 700_000_000, "not enough memory"),
        ("runs --verify", resource.RLIMIT_AS, 36_000_000, "not enough memory"),
        pytest.param(
            "demo",
            resource.RLIMIT_FSIZE,
            0,
            "cannot be written: File too large",
            marks=pytest.mark.slow,
        ),
        ("init new", resource.RLIMIT_FSIZE, 100, "cannot be written: File too large"),
    ],
)
def test_a_shortage_is_named_without_a_traceback(
    words: str,
    limit: int,
    size: int,
    expected: str,
    tmp_path: Path,
    measured: Callable[[str], None],
) -> None:
    done = run_with_limit(words.split(), tmp_path, limit, size)
    assert "Traceback" not in done.stderr
    assert expected in done.stderr
    assert done.returncode == 7
    assert not list(tmp_path.rglob("*.tmp"))
    measured("exit 7, no traceback")


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (MemoryError(), "not enough memory"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "not enough memory"),
        (ImportError("libx.so: failed to map segment from shared object"), "not enough memory"),
        (RuntimeError("can't start new thread"), "no more processes"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "no more processes"),
        (OSError(errno.EMFILE, "Too many open files"), "too many files"),
        (OSError(errno.ENOSPC, "No space left on device", "/a/b"), "/a/b: the disk is full"),
        (OSError(errno.EROFS, "Read-only file system"), "disk is read-only"),
        (OSError(errno.EFBIG, "File too large"), "exceed the size limit"),
    ],
)
def test_a_shortage_is_named_from_an_error_or_its_cause(error: Exception, expected: str) -> None:
    outer = OSError("could not load the library")
    outer.__context__ = error
    assert expected in str(named_error(error))
    assert expected in str(named_error(outer))


def test_an_internal_error_is_not_reported_as_a_shortage() -> None:
    assert as_shortage(KeyError("a")) is None
    with pytest.raises(KeyError):
        named_error(KeyError("a"))


def test_a_memory_request_beyond_the_address_space_is_refused() -> None:
    require_memory(1 << 20)
    with raises_code(ShortageError, "RID-SYSTEM-SHORTAGE", "`ulimit -v`", f"{1 << 40} MB"):
        require_memory(1 << 60)


class _Unstartable(HelperProcess):
    def start(self) -> None:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")


@pytest.mark.fault(50)
def test_no_process_is_left_if_one_cannot_start(measured: Callable[[str], None]) -> None:
    first = HelperProcess("first", signal.pause, (), patience_s=0.0)
    with raises_code(ShortageError, "RID-SYSTEM-SHORTAGE", "`ulimit -u`"):
        start_all([first, _Unstartable("second", signal.pause, (), patience_s=0.0)])
    first.end()
    assert first.exit_code == -signal.SIGKILL
    measured("0 processes left")


NOT_JSON: list[tuple[bytes, bytes, str]] = [
    (b'"cycle_time_ms": 8', b'"cycle_time_ms": NaN', "cell.cycle_time_ms: is not a finite number"),
    (b'"cycle_time_ms": 8', b'"cycle_time_ms": 1e999', "cell.cycle_time_ms"),
    (b'"cycle_time_ms": 8', b'"cycle_time_ms": ' + b"9" * 5000, "cell.cycle_time_ms"),
    (b'"cycle_time_ms": 8', b'"cycle_time_ms": 8, "cycle_time_ms": 9', "occurs twice"),
    (b'"cycle_time_ms": 8', b'"x": ' + b"[" * 5000 + b"]" * 5000, "nested"),
    (b'"cycle_time_ms": 8', b'"x": "\\ud800"', "cell.x: contains half a character"),
    (b'"headline"', b'"headlin"', "verdict.headline"),
    (b'"robot"', b'"robott"', "robot"),
    (b'"measured"', b'"measuret"', "curves.torque.axes.0.measured: the key 'measured' is missing"),
    (b'"axes"', b'"axis"', "validation.axes: the key 'axes' is missing"),
]


@pytest.mark.fault(50)
@pytest.mark.parametrize(("old", "new", "expected"), NOT_JSON, ids=[row[2] for row in NOT_JSON])
def test_a_damaged_result_is_refused_by_its_key(
    old: bytes,
    new: bytes,
    expected: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    folder = RunFolder.create(tmp_path, "changed")
    data = json.dumps(whole_result()).encode()
    assert old in data
    folder.write("result.json", data.replace(old, new))
    assert run(["report", str(folder.path)]) == 7
    message = capsys.readouterr().err
    assert "result.json" in message
    assert expected in message
    measured("the error names file and key")


@pytest.mark.slow
def test_a_dollar_sign_in_a_name_is_not_a_formula(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "dollars")
    data = (
        json.dumps(whole_result()).replace("axis1", r"$\\frac{").replace("axis2", r"\\$x$ \u202e")
    )
    folder.write("result.json", data.encode())
    assert run(["report", str(folder.path)]) == 0
    page = folder.file("report.html").read_text(encoding="utf-8")
    assert r"$\frac{" in page
    assert "\u202e" not in page
