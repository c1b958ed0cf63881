"""Bash, zsh and fish complete commands, options and choices without importing NumPy."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rid_daq import app
from rid_daq.app import run
from rid_daq.command_line.root import COMMANDS


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment with a program that reports at its end the slow modules in use."""
    program = tmp_path / "rid-daq"
    program.write_text(
        f"#!{sys.executable}\nimport atexit, sys\n"
        "from rid_daq.app import main\n"
        "heavy = {'numpy', 'pinocchio', 'rid_daq.operations.experiment.recorded_motion'}\n"
        "told = lambda: print('heavy:', sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
        "atexit.register(told)\n"
        "main()\n"
    )
    program.chmod(0o700)
    root = str(Path(app.__file__).resolve().parents[1])
    path = f"{tmp_path}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONPATH": root, "HOME": str(tmp_path)}


def run_in_shell(shell: str, arguments: list[str], environment: dict[str, str]) -> list[str]:
    """Run a script in a shell, and return its output lines.

    Assert that the program imports none of the modules that take long.
    """
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
        'eval "$(_RID_DAQ_COMPLETE=bash_source rid-daq)"; complete -p rid-daq;'
        "COMP_WORDS=(rid-daq re) COMP_CWORD=1; _rid_daq_completion rid-daq;"
        'echo "${COMPREPLY[*]}"'
    )
    complete, names = run_in_shell("bash", ["--norc", "-c", typed], environment)
    assert complete.endswith("-F _rid_daq_completion rid-daq")
    assert sorted(names.split()) == WITH_RE


def test_zsh_completes_commands_and_options_with_descriptions(
    environment: dict[str, str],
) -> None:
    typed = (
        "compdef() { print -r -- compdef $@ }; _describe() { print -rl -- ${(P)3} };"
        'eval "$(_RID_DAQ_COMPLETE=zsh_source rid-daq)";'
        "words=(rid-daq re); CURRENT=2; _rid_daq_completion;"
        "words=(rid-daq design --kin); CURRENT=3; _rid_daq_completion"
    )
    first, *shown = run_in_shell("zsh", ["-f", "-c", typed], environment)
    assert first == "compdef _rid_daq_completion rid-daq"
    text = "\n".join(shown)
    for name in WITH_RE:
        assert f"{name}:{COMMANDS[name]}" in text
    assert "--kind:" in text


def test_fish_completes_commands_options_and_commands_of_groups(
    environment: dict[str, str],
) -> None:
    typed = (
        "_RID_DAQ_COMPLETE=fish_source rid-daq | source;"
        "complete -C 'rid-daq re'; complete -C 'rid-daq design --kin';"
        "complete -C 'rid-daq payload ex'"
    )
    shown = run_in_shell("fish", ["--no-config", "-c", typed], environment)
    found = dict(line.split("\t") for line in shown)
    assert found.keys() == {*WITH_RE, "--kind", "export"}
    assert all(COMMANDS[name].startswith(found[name]) for name in WITH_RE)


@pytest.mark.parametrize("command", ["design", "retime"])
def test_bash_completes_a_word_that_is_not_an_option_as_a_file(
    command: str, environment: dict[str, str]
) -> None:
    typed = (
        'eval "$(_RID_DAQ_COMPLETE=bash_source rid-daq)"; compopt() { echo "$2"; };'
        f'COMP_WORDS=(rid-daq {command} ce) COMP_CWORD=2; _rid_daq_completion rid-daq; echo "$?"'
    )
    assert run_in_shell("bash", ["--norc", "-c", typed], environment) == ["default", "0"]


def test_the_choices_of_an_option_are_completed(environment: dict[str, str]) -> None:
    typed = (
        'eval "$(_RID_DAQ_COMPLETE=bash_source rid-daq)";'
        "COMP_WORDS=(rid-daq design --kind rev) COMP_CWORD=3; _rid_daq_completion rid-daq;"
        'echo "${COMPREPLY[*]}"'
    )
    assert run_in_shell("bash", ["--norc", "-c", typed], environment) == ["reversed"]


@pytest.mark.parametrize(
    ("shell", "files", "typed"),
    [
        ("bash", [".local/share/rid-daq/completion.bash", ".bashrc"], ["--rcfile", ".bashrc"]),
        ("zsh", [".local/share/rid-daq/completion.zsh", ".zshrc"], []),
        ("fish", [".config/fish/completions/rid-daq.fish"], []),
    ],
)
def test_completion_is_installed_once_and_for_one_user(
    shell: str,
    files: list[str],
    typed: list[str],
    environment: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", f"/bin/{shell}")
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(name, raising=False)
        environment.pop(name, None)
    (tmp_path / ".bashrc").write_text("alias ll='ls -l'")  # without a line end
    assert run(["--install-completion"]) == 0
    written = {name: (tmp_path / name).read_bytes() for name in files}
    assert run(["--install-completion", shell]) == 0
    assert {name: (tmp_path / name).read_bytes() for name in files} == written
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    questions = {
        "bash": "complete -p rid-daq",
        "zsh": "print $_comps[rid-daq]",
        "fish": "complete -C 'rid-daq reco'",
    }
    done = subprocess.run(
        [shell, *typed, "-i", "-c", questions[shell]],
        capture_output=True,
        text=True,
        timeout=60.0,
        cwd=tmp_path,
        env={**environment, "ZDOTDIR": str(tmp_path)},
        check=True,
    )
    assert "_rid_daq_completion" in done.stdout or "recover" in done.stdout


def test_a_shell_without_completion_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SHELL", "/bin/tcsh")
    for option in ("--install-completion", "--show-completion"):
        assert run([option]) == 2
        assert "RID-OPTION-NAME" in capsys.readouterr().err
    assert run(["--show-completion", "fish"]) == 0
    assert "_RID_DAQ_COMPLETE=fish_complete" in capsys.readouterr().out
