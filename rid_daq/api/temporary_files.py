"""`request_folder`: temporary files of a request; texts name the arguments instead of the files."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from config.errors import RidDaqError

CELL, MOTION, MODEL, PAYLOAD = "cell.yaml", "motion.yaml", "model.json", "payload.json"
MADE = "made.yaml"

_ARGUMENTS: Final = {
    MOTION: "the motion",
    MODEL: "the model",
    PAYLOAD: "the payload",
    MADE: "Motion",
}


@contextmanager
def request_folder() -> Iterator[Path]:
    """Yield a temporary folder for the files of a request.

    Raises:
        RidDaqError: The error of the `with` block, without names of temporary files.
    """
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as name:
        folder = Path(name)
        with changed_text(lambda text: without_files(text, folder)):
            yield folder


@contextmanager
def changed_text(change: Callable[[str], str]) -> Iterator[None]:
    """Change the text of a `RidDaqError` that the `with` block raises.

    Args:
        change: Function that returns the new text.

    Raises:
        RidDaqError: The error of the `with` block, with the new text and the same code.
    """
    try:
        yield
    except RidDaqError as error:
        text = change(str(error))
        if text == str(error):
            raise
        raise type(error)(text, code=error.refusal) from None


def without_files(text: str, folder: Path) -> str:
    """Return a text with the arguments of a function instead of its temporary files."""
    text = text.replace(f"{folder}/", "")
    for name, argument in _ARGUMENTS.items():
        text = re.sub(rf"(?<![\w/.-]){re.escape(name)}(?![\w.-])", argument, text)
    return text
