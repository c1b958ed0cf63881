"""Fields that several operations on payloads have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from rid_daq.requests.option import Option

PayloadFile = Annotated[
    Path,
    Field(
        description="A payload file; or a session or run that has one: a folder, an id, a label or"
        " `latest`."
    ),
    Option(positional=True, metavar="PAYLOAD", file="input"),
]
