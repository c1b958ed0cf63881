"""Bash, zsh and fish complete commands, options and what they choose among, without numerics."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rid_daq import app
from rid_daq.app import COMMANDS


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment with a program that says what it has imported when it ends."""
    program = tmp_path / "rid-daq"
    program.write_text(
        f"#!{sys.executable}\nimport atexit, sys\n"
        "from rid_daq.app import main\n"
        "heavy = {'numpy', 'pinocchio', 'rid_daq.performers.record'}\n"
        "told = lambda: print('heavy:', sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
        "atexit.register(told)\n"
        "main()\n"
    )
    program.chmod(0o700)
    root = str(Path(app.__file__).resolve().parents[1])
    path = f"{tmp_path}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONPATH": root, "HOME": str(tmp_path)}


def typed_in(shell: str, arguments: list[str], environment: dict[str, str]) -> list[str]:
    """Let a shell run a script, and return the lines that it writes."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    done = subprocess.run(
        [shell, *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=120.0,
        env=environment,
    )
    assert set(done.stderr.splitlines()) == {"heavy: []"}
    return done.stdout.splitlines()


WITH_RE = sorted(name for name in COMMANDS if name.startswith("re"))


def test_bash_completes_commands_without_importing_any(environment: dict[str, str]) -> None:
    typed = (
        'eval "$(_RID_DAQ_COMPLETE=source_bash rid-daq)"; complete -p rid-daq;'
        "COMP_WORDS=(rid-daq re) COMP_CWORD=1; _rid_daq_completion rid-daq;"
        'echo "${COMPREPLY[*]}"'
    )
    complete, names = typed_in("bash", ["--norc", "-c", typed], environment)
    assert complete.endswith("-F _rid_daq_completion rid-daq")
    assert sorted(names.split()) == WITH_RE


def test_zsh_completes_commands_and_options_with_what_they_are(
    environment: dict[str, str],
) -> None:
    typed = (
        "compdef() { print -r -- compdef $@ }; _arguments() { print -rl -- $@ };"
        'eval "$(_RID_DAQ_COMPLETE=source_zsh rid-daq)";'
        "words=(rid-daq re); CURRENT=2; _rid_daq_completion;"
        "words=(rid-daq design --kin); CURRENT=3; _rid_daq_completion"
    )
    first, *shown = typed_in("zsh", ["-f", "-c", typed], environment)
    assert first == "compdef _rid_daq_completion rid-daq"
    text = "\n".join(shown)
    for name in WITH_RE:
        words = COMMANDS[name].replace("'", "")  # as Typer quotes for zsh
        assert f'"{name}":"{words}"' in text
    assert '"--kind":"' in text


def test_fish_completes_commands_options_and_commands_of_groups(
    environment: dict[str, str],
) -> None:
    typed = (
        "_RID_DAQ_COMPLETE=source_fish rid-daq | source;"
        "complete -C 'rid-daq re'; complete -C 'rid-daq design --kin';"
        "complete -C 'rid-daq payload ex'"
    )
    shown = typed_in("fish", ["--no-config", "-c", typed], environment)
    found = dict(line.split("\t") for line in shown)
    assert found.keys() == {*WITH_RE, "--kind", "export"}
    assert all(found[name] == COMMANDS[name] for name in WITH_RE)
