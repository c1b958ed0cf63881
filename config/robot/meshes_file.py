"""`MeshesFile`: the file with the meshes of a robot's links, next to the robot file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from config.errors import ConfigError
from config.formats.approved_files import SHORT, sha256_of
from config.formats.bounded_file import read_file
from config.meshes.link_meshes_file import CODE, MOST_BYTES
from config.model import ConfigModel


class MeshesFile(ConfigModel):
    """File with the meshes of the links; they are drawn, and never used to check a distance.

    Attributes:
        file: Name of the file, which is in the folder of the robot file.
        sha256: SHA-256 of the file.
    """

    file: Annotated[str, Field(pattern=r"^[A-Za-z0-9][\w-]{0,55}\.meshes$")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]

    @classmethod
    def of(cls, name: str, content: bytes) -> MeshesFile:
        """Return the entry of a file with some bytes."""
        return cls(file=name, sha256=sha256_of(content))

    def read(self, folder: Path) -> bytes:
        """Return the bytes of the file.

        Args:
            folder: Folder of the robot file.

        Raises:
            ConfigError: The file cannot be read, or its SHA-256 is another one.
        """
        path = folder / self.file
        try:
            content = read_file(path, MOST_BYTES)
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {error.strerror}", code=CODE) from None
        if (found := sha256_of(content)) != self.sha256:
            raise ConfigError(
                f"{path}: its SHA-256 {found[:SHORT]}… differs from {self.sha256[:SHORT]}… in"
                " `meshes` of the robot file",
                code=CODE,
            )
        return content
