from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from config import errors
from rid_daq import app
from rid_daq.app import run
from rid_daq.command_line.root import COMMANDS
from rid_daq.operations.catalogue import operation
from rid_daq.operations.operation import Operation, OperationResult
from rid_daq.requests.request import Request
from rid_daq.terminal.console import as_command, make_printable
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of

CODES = {
    errors.ConfigError: 2,
    errors.LimitError: 3,
    errors.PreflightError: 3,
    errors.DriverError: 4,
    errors.TransportError: 4,
    errors.DeviceTimeoutError: 4,
    errors.ProtocolError: 4,
    errors.DeviceFaultError: 4,
    errors.SafetyStop: 5,
    errors.DataQualityError: 6,
    errors.EstimationError: 6,
    errors.RecordingError: 7,
    errors.LockedError: 8,
    errors.ShortageError: 7,
    errors.ServiceError: 4,
}


@pytest.mark.parametrize(("kind", "code"), CODES.items(), ids=lambda x: getattr(x, "__name__", x))
def test_every_error_class_has_its_exit_code(kind: type[errors.RidDaqError], code: int) -> None:
    assert exit_code_of(kind("what, where, what to do")) == code


def test_the_table_of_exit_codes_lists_every_error_class() -> None:
    def below(kind: type[errors.RidDaqError]) -> set[type[errors.RidDaqError]]:
        return {kind}.union(*(below(child) for child in kind.__subclasses__()))

    named = {kind for kind in below(errors.RidDaqError) if kind.__module__ == "config.errors"}
    assert named - {errors.RidDaqError} == set(CODES)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_a_help_text(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([name, "--help"]) == 0
    assert f"rid-daq {name}" in capsys.readouterr().out


def test_the_list_of_commands_is_shown_without_importing_any(
    capsys: pytest.CaptureFixture[str],
) -> None:
    program = (
        "import sys; from rid_daq.app import run; code = run(['--help']);"
        "heavy = {'pydantic', 'numpy', 'pinocchio', 'matplotlib', 'numba', 'can', 'mcap'};"
        "heavy &= set(sys.modules);"
        "print('heavy:', sorted(heavy)); sys.exit(code)"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120.0, check=True
    )
    assert all(name in shown.stdout for name in COMMANDS)
    assert "heavy: []" in shown.stdout
    assert "emergency stop is required" in " ".join(shown.stdout.split())


def test_the_help_of_a_command_imports_no_operation_of_another() -> None:
    program = (
        "import sys; from rid_daq.app import run; run(['demo', '--help']);"
        "parts = [n.split('.') for n in sys.modules if n.startswith('rid_daq.operations')];"
        "print('groups:', {name[2] for name in parts if len(name) == 4})"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120.0, check=True
    )
    assert shown.stdout.endswith("groups: {'start'}\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rusn"], "Did you mean 'runs'"),
        (["record"], "Missing argument 'CELL'"),
        (["demo", "--sed", "1"], "No such option"),
    ],
)
def test_a_mistyped_command_line_gives_exit_code_2(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""
    assert run([*words, "--json"]) == ExitCode.USAGE
    assert json.loads(capsys.readouterr().out)["error"]["kind"] == "UsageError"


class EmptyRequest(Request):
    """Request without options, for an operation that a test replaces."""


def replace_command(does: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the operation of every command by one that calls `does`."""

    def run_it(_request: EmptyRequest, _context: object) -> OperationResult:
        does()
        raise AssertionError

    found = Operation("recover", "Recover", EmptyRequest, run_it, ())
    monkeypatch.setattr("rid_daq.command_line.root.operation", lambda _name: found)


def command_that_raises(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise error

    replace_command(fail, monkeypatch)


def test_an_error_gives_one_message_and_its_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    error = errors.PreflightError("node 3: 6007h is 0")
    command_that_raises(error, monkeypatch)
    assert run(["recover"]) == ExitCode.PREFLIGHT
    captured = capsys.readouterr()
    assert captured.err == "rid-daq: node 3: 6007h is 0\n"
    assert captured.out == ""


def test_an_operating_system_error_of_a_file_gives_one_message(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def closed(*_arguments: object) -> object:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "secret/manifest.json")

    monkeypatch.setattr("acquisition.runs.catalogue.list_runs", closed)
    assert run(["runs"]) == ExitCode.STORAGE
    expected = "rid-daq: secret/manifest.json: Permission denied [RID-FILE-ACCESS]\n"
    assert capsys.readouterr().err == expected


def test_with_json_an_error_is_a_document(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    error = errors.LockedError("held by process 7")
    command_that_raises(error, monkeypatch)
    assert run(["recover", "--json"]) == ExitCode.LOCKED
    problem = json.loads(capsys.readouterr().out)["error"]
    assert problem == {"kind": "LockedError", "message": "held by process 7", "exit_code": 8}


def test_ctrl_c_gives_exit_code_130(monkeypatch: pytest.MonkeyPatch) -> None:
    command_that_raises(KeyboardInterrupt(), monkeypatch)
    assert run(["recover"]) == ExitCode.INTERRUPTED


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_with_json_a_signal_is_a_document(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def raise_signal() -> None:
        signal.signal(number, app._end_once)
        signal.raise_signal(number)

    replace_command(raise_signal, monkeypatch)
    code, word = (130, "interrupted") if number is signal.SIGINT else (143, "terminated")
    assert run(["recover", "--json"]) == code
    captured = capsys.readouterr()
    assert captured.err == f"rid-daq: {word}\n"
    assert json.loads(captured.out)["error"] == {
        "kind": word.capitalize(),
        "message": word,
        "exit_code": code,
    }


def test_ctrl_c_during_the_import_of_a_command_takes_effect_afterwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    received: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: received.append(number))

    def imported(name: str) -> Operation:
        signal.raise_signal(signal.SIGINT)
        assert not received
        return operation(name)

    monkeypatch.setattr("rid_daq.command_line.root.operation", imported)
    run(["recover", "--help"])
    assert received == [signal.SIGINT]


def test_ctrl_c_while_the_program_is_imported_leaves_no_traceback() -> None:
    program = (
        "import os, signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_rest):\n"
        "        if name == 'rid_daq.app':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "import rid_daq.__main__\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True)
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, b"")


def test_an_internal_error_is_not_reported_as_a_user_error(monkeypatch: pytest.MonkeyPatch) -> None:
    command_that_raises(ZeroDivisionError(), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        run(["recover"])


def test_a_closed_pipe_during_help_is_not_an_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run(
        [sys.executable, "-m", "rid_daq", "--help"],
        check=False,
        stdout=writing,
        stderr=subprocess.PIPE,
    )
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")


def test_a_broken_pipe_other_than_the_output_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path(os.devnull).open("w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        command_that_raises(BrokenPipeError(errno.EPIPE, "Broken pipe"), monkeypatch)
        with pytest.raises(BrokenPipeError):
            run(["recover"])


def test_control_characters_of_devices_never_reach_the_terminal() -> None:
    assert make_printable("drive says \x1b[2J\x07\n\tµ") == "drive says \\x1b[2J\\x07\n\tµ"


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 143)]
)
def test_the_first_signal_ends_the_program_and_later_ones_are_ignored(
    number: signal.Signals, code: int
) -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {other: signal.getsignal(other) for other in numbers}
    try:
        with pytest.raises(SystemExit) as end:
            app._end_once(number, None)
        assert end.value.code == code
        assert all(signal.getsignal(other) == signal.SIG_IGN for other in numbers)
    finally:
        for other, handler in before.items():
            signal.signal(other, handler)


def test_a_shown_command_is_quoted_for_the_shell() -> None:
    words = ("check", Path("Zelle Ü 1") / "cell.yaml")
    assert as_command(*words) == "rid-daq check 'Zelle Ü 1/cell.yaml'"
    assert as_command("check", "ir361") == "rid-daq check ir361"
