"""Shell completion: its script, and its installation for one user."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

import click
from click.shell_completion import get_completion_class

from config.errors import ConfigError, RecordingError, system_errors
from config.formats.whole_file import write_whole

PROGRAM: Final = "rid-daq"
VARIABLE: Final = "_RID_DAQ_COMPLETE"
"""Environment variable with which a shell requests completions."""

SHELLS: Final = ("bash", "zsh", "fish")
_LOGIN: Final = "login shell"


def completion_script(shell: str) -> str:
    """Return the script with which a shell completes commands and options of this program.

    Args:
        shell: One of `SHELLS`.
    """
    found = get_completion_class(shell)
    assert found is not None
    return found(click.Command(PROGRAM), {}, PROGRAM, VARIABLE).source()


def install(shell: str) -> list[Path]:
    """Install the completion script for this user, and return the written files.

    fish reads the script from its folder of completions. For bash and zsh, lines in `.bashrc` or
    `.zshrc` read it; they are added only once.

    Args:
        shell: One of `SHELLS`.

    Raises:
        RecordingError: A file cannot be written.
    """
    home = Path.home()
    if shell == "fish":
        settings = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config")
        return [_write_script(settings / "fish" / "completions" / f"{PROGRAM}.fish", shell)]
    data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
    target = _write_script(data / PROGRAM / f"completion.{shell}", shell)
    needed = "" if shell == "bash" else "autoload -Uz compinit; compinit\n"
    lines = f"\n{needed}source '{target}'\n"
    start = home / f".{shell}rc"
    with system_errors(
        RecordingError, f"{start}: cannot add a line to this file", code="RID-FILE-WRITE"
    ):
        if start.is_file() and lines.encode() in start.read_bytes():
            return [target]
        with start.open("a", encoding="utf-8") as file:
            file.write(lines)
    return [target, start]


def _write_script(target: Path, shell: str) -> Path:
    folder = target.parent
    with system_errors(RecordingError, f"{folder}: cannot make this folder", code="RID-FILE-WRITE"):
        folder.mkdir(parents=True, exist_ok=True)
    write_whole(target, completion_script(shell).encode())
    return target


def _shell_of_option(text: str) -> str:
    """Return the shell that an option names, or the login shell.

    Raises:
        ConfigError: This shell is not supported.
    """
    shell = Path(os.environ.get("SHELL", "")).name if text == _LOGIN else text
    if shell not in SHELLS:
        raise ConfigError(
            f"{shell or 'no login shell (SHELL is not set)'}: completion is not supported; name one"
            f" of the shells {', '.join(SHELLS)}",
            code="RID-OPTION-NAME",
        )
    return shell


def _print_script(ctx: click.Context, _param: click.Parameter, text: str | None) -> None:
    if text is not None and not ctx.resilient_parsing:
        click.echo(completion_script(_shell_of_option(text)), nl=False)
        ctx.exit()


def _install_script(ctx: click.Context, _param: click.Parameter, text: str | None) -> None:
    if text is not None and not ctx.resilient_parsing:
        for path in install(_shell_of_option(text)):
            click.echo(f"wrote {path}")
        click.echo("New shells complete commands and options.")
        ctx.exit()


Callback = Callable[[click.Context, click.Parameter, str | None], None]


def _completion_option(flag: str, help_text: str, callback: Callback) -> click.Option:
    return click.Option(
        [flag],
        metavar="[SHELL]",
        is_flag=False,
        flag_value=_LOGIN,
        expose_value=False,
        is_eager=True,
        callback=callback,
        help=f"{help_text} for bash, zsh or fish (default: the login shell).",
    )


def completion_options() -> list[click.Parameter]:
    """Return the program's options that install and print the completion script."""
    return [
        _completion_option(
            "--install-completion",
            "Install the completion of commands and options",
            _install_script,
        ),
        _completion_option("--show-completion", "Print the completion script", _print_script),
    ]
