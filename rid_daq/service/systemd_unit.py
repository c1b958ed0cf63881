"""`SystemdUnit`: systemd unit of the service; `--install` writes it, and the service updates it."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import ConfigError, RecordingError, system_errors
from config.formats.whole_file import write_whole
from config.process.own_process import own_python
from rid_daq.session.versions import program_version

NAME: Final = "rid-daq.service"
_HEAD: Final = "# Written by rid-daq"
_TEXT = """\
{head} {version}; newer versions overwrite this file. Put your own changes into
# {name}.d/own.conf (`systemctl edit`), which rid-daq does not change.
[Unit]
Description=rid-daq: {cells}
After=network.target

[Service]
Type=exec
WorkingDirectory={folder}
ExecStart={command}
# On SIGTERM the service stops all motions, and its workers end by themselves.
KillSignal=SIGTERM
KillMode=mixed
TimeoutStopSec=45
Restart=on-failure
RestartSec=2
LimitRTPRIO=99
LimitMEMLOCK=infinity

[Install]
WantedBy={target}
"""


@dataclass(frozen=True)
class SystemdUnit:
    """Systemd unit of this program.

    Attributes:
        path: Path of the unit file.
        text: Content of the unit file.
    """

    path: Path
    text: str

    @classmethod
    def of(cls, cells: Sequence[str], folder: Path, arguments: Sequence[str]) -> SystemdUnit:
        """Return the unit of a service: a system unit for root, else a user unit.

        Args:
            cells: Names of the served cells.
            folder: Folder of the service.
            arguments: Command line after `rid-daq serve`.
        """
        is_root = os.geteuid() == 0
        home = Path("/etc/systemd/system")
        if not is_root:
            own = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
            home = Path(own) / "systemd" / "user"
        program = own_python("rid_daq", "serve", *arguments)
        text = _TEXT.format(
            head=_HEAD,
            version=program_version(),
            name=NAME,
            cells=_escape(", ".join(cells)),
            folder=_escape(str(folder.resolve())),
            command=_escape(shlex.join(program)),
            target="multi-user.target" if is_root else "default.target",
        )
        return cls(home / NAME, text)

    def install(self) -> str:
        """Write the unit file; return the command that the user runs next.

        Raises:
            ConfigError: The file exists and was not written by rid-daq.
            RecordingError: The file cannot be written.
        """
        with system_errors(
            RecordingError, f"{self.path}: cannot be written", code="RID-FILE-WRITE"
        ):
            before = self.path.read_text(encoding="utf-8") if self.path.exists() else _HEAD
            if not before.startswith(_HEAD):
                raise ConfigError(
                    f"{self.path}: exists and was not written by rid-daq: move it to another place",
                    code="RID-FILE-EXISTS",
                )
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self.path, self.text.encode())
        user = "" if os.geteuid() == 0 else " --user"
        return f"systemctl{user} daemon-reload && systemctl{user} enable --now {NAME}"

    def keep_current(self) -> bool:
        """Rewrite the unit file if systemd started this program from an older version of the file.

        Returns:
            True if the file was written.
        """
        if "INVOCATION_ID" not in os.environ or not self.path.exists():
            return False
        try:
            before = self.path.read_text(encoding="utf-8")
        except OSError:
            return False
        if before == self.text or not before.startswith(_HEAD):
            return False
        try:
            write_whole(self.path, self.text.encode())
        except (OSError, RecordingError):
            return False
        return True


def _escape(text: str) -> str:
    """Return the text for systemd: percent signs doubled, line breaks replaced by spaces."""
    return text.replace("%", "%%").replace("\n", " ")
