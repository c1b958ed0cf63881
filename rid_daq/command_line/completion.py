"""Shell completion: its script, and how it is installed for one user."""

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
"""The environment variable by which a shell asks for completions."""

SHELLS: Final = ("bash", "zsh", "fish")
_LOGIN: Final = "login shell"


def completion_script(shell: str) -> str:
    """Return what a shell runs to complete the words of this program.

    Args:
        shell: One of `SHELLS`.
    """
    found = get_completion_class(shell)
    assert found is not None
    return found(click.Command(PROGRAM), {}, PROGRAM, VARIABLE).source()


def install(shell: str) -> list[Path]:
    """Write the script where a shell of this user finds it, and return the files changed.

    fish reads its folder of completions. bash and zsh read the script by a line at the end of
    `.bashrc` or `.zshrc`, which is added once.

    Args:
        shell: One of `SHELLS`.

    Raises:
        RecordingError: A file cannot be written.
    """
    home = Path.home()
    if shell == "fish":
        settings = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config")
        return [_written(settings / "fish" / "completions" / f"{PROGRAM}.fish", shell)]
    data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
    target = _written(data / PROGRAM / f"completion.{shell}", shell)
    needed = "" if shell == "bash" else "autoload -Uz compinit; compinit\n"
    lines = f"\n{needed}source '{target}'\n"
    start = home / f".{shell}rc"
    with system_errors(RecordingError, f"{start}: cannot be extended", code="RID-FILE-WRITE"):
        if start.is_file() and lines.encode() in start.read_bytes():
            return [target]
        with start.open("a", encoding="utf-8") as file:
            file.write(lines)
    return [target, start]


def _written(target: Path, shell: str) -> Path:
    folder = target.parent
    with system_errors(RecordingError, f"{folder}: cannot be made", code="RID-FILE-WRITE"):
        folder.mkdir(parents=True, exist_ok=True)
    write_whole(target, completion_script(shell).encode())
    return target


def _chosen(text: str) -> str:
    """Return the shell that an option names, or the login shell.

    Raises:
        ConfigError: There is no completion for it.
    """
    shell = Path(os.environ.get("SHELL", "")).name if text == _LOGIN else text
    if shell not in SHELLS:
        raise ConfigError(
            f"{shell or 'no login shell (SHELL is not set)'}: there is no completion for it; name"
            f" one of {', '.join(SHELLS)}",
            code="RID-OPTION-NAME",
        )
    return shell


def _show(ctx: click.Context, _param: click.Parameter, text: str | None) -> None:
    if text is not None and not ctx.resilient_parsing:
        click.echo(completion_script(_chosen(text)), nl=False)
        ctx.exit()


def _install(ctx: click.Context, _param: click.Parameter, text: str | None) -> None:
    if text is not None and not ctx.resilient_parsing:
        for path in install(_chosen(text)):
            click.echo(f"wrote {path}")
        click.echo("Shells that are started from now on complete commands and options.")
        ctx.exit()


Callback = Callable[[click.Context, click.Parameter, str | None], None]


def _option(flag: str, help_text: str, callback: Callback) -> click.Option:
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
    """Return the options of the program by which completion is installed and shown."""
    return [
        _option("--install-completion", "Install the completion of commands and options", _install),
        _option("--show-completion", "Print the completion script", _show),
    ]
