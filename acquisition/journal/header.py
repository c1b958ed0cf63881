"""`JournalHeader`: header of a recording; `HeaderModel`: common part of all headers."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from typing import Literal, Self, TypeVar

from pydantic import Field, ValidationError

from config.cell.torque_filter import ButterworthFilter
from config.errors import RecordingError
from config.model import ConfigModel
from config.quantities import MOST_JOINTS, Positive
from config.wrong_value import explain_error

Layout = Literal["cell", "import", "commanded import"]
"""Layout of the rows of a recording."""


class HeaderModel(ConfigModel):
    """Header with a checksum.

    A file has two copies, so that damage at one place leaves one copy.
    """

    def to_metadata(self) -> dict[str, str]:
        """Return the header as the text pairs of an MCAP metadata record or channel."""
        text = self.model_dump_json()
        return {"header": text, "crc32": str(zlib.crc32(text.encode()))}

    @classmethod
    def from_metadata(cls, pairs: Mapping[str, str]) -> Self:
        """Return the header that `to_metadata` wrote.

        Raises:
            RecordingError: The pairs are not those of a header, or are damaged.
        """
        text = pairs.get("header", "")
        if pairs.get("crc32") != str(zlib.crc32(text.encode())):
            raise RecordingError(
                "the header of the recording is missing or damaged", code="RID-RECORDING-DAMAGED"
            )
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"]))
            raise RecordingError(
                f"the header of the recording: {place}: {explain_error(first)}",
                code="RID-RECORDING-DAMAGED",
            ) from error


class JournalHeader(HeaderModel):
    """Everything needed to read the rows as a `Recording`, even without the run folder.

    `sample_period_s` is None if the time stamps are not uniform, as in imported recordings.
    `has_commands` is True if the rows of an import have velocity commands.
    """

    joint_names: tuple[str, ...] = Field(min_length=1, max_length=MOST_JOINTS)
    sample_period_s: Positive | None
    source: Literal["cell", "import"] = "cell"
    has_commands: bool = False
    samples_per_period: int | None = None
    torque_filter: ButterworthFilter | None = None
    cell_name: str = ""
    robot_name: str = ""
    run_id: str = ""

    @property
    def layout(self) -> Layout:
        """Layout of the rows."""
        return "commanded import" if self.has_commands else self.source


H = TypeVar("H", bound=HeaderModel)


def first_header(model: type[H], candidates: Iterable[Mapping[str, str]]) -> H | None:
    """Return the first undamaged header copy of a file; None if there is no such copy."""
    for pairs in candidates:
        try:
            return model.from_metadata(pairs)
        except RecordingError:
            continue
    return None
