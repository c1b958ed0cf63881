"""`MadeFile`: kinds of files that operations write, and marks to recognise them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.formats.bounded_file import open_file

_LOOKED_AT: Final = 1 << 16
_LARGEST: Final = 1 << 40


@dataclass(frozen=True)
class MadeFile:
    """A kind of file that operations write.

    Attributes:
        words: Name of the kind, for messages.
        mark: Pattern in the first or last 64 KiB of every such file that rid-daq wrote.
    """

    words: str
    mark: re.Pattern[bytes]

    def is_at(self, path: Path) -> bool:
        """Return True if a file is of this kind and was written by rid-daq.

        Raises:
            OSError: The file cannot be read.
        """
        with open_file(path, _LARGEST) as file:
            head = file.read(_LOOKED_AT)
            size = file.seek(0, 2)
            file.seek(max(len(head), size - _LOOKED_AT))
            return self.mark.search(head + file.read(_LOOKED_AT)) is not None


def _document(kind: str, words: str) -> MadeFile:
    return MadeFile(
        words, re.compile(rb'\A\s*\{(?s:.*)"(format|kind|schema)":\s*"rid-daq ' + kind.encode())
    )


MOTION: Final = MadeFile(
    "a motion by `design` or `retime`",
    re.compile(rb"\A(#[^\n]*\n)*#[^\n]*(rid-daq|verified within its limits)(?s:.*)^kind:", re.M),
)
MODEL: Final = _document("estimate", "a model by `identify`")
PAYLOAD: Final = _document("payload", "a payload by `payload identify`")
LOOPS: Final = _document("velocity loops", "velocity loops by `loop`")
FEEDFORWARD: Final = _document("feedforward", "a feedforward by `compensate` or `refine`")
CERTIFICATE: Final = MadeFile("a certificate", re.compile(rb"\A%PDF(?s:.*)rid-daq"))
REPORT: Final = MadeFile("a report", re.compile(rb"\A\s*<!doctype html(?s:.*)rid-daq", re.I))
TABLE: Final = MadeFile("a table by `sensitivity`", re.compile(rb"\Arow,wrong,less,"))
POSES: Final = MadeFile(
    "an unfilled table by `calibrate poses`",
    re.compile(rb"\Apose,[^\n]*,nominal_z_m\n([^\n]*,,,,[^\n]*\n?)+\Z"),
)
TRACKED: Final = MadeFile(
    "measurements of a simulated tracker", re.compile(rb"\Atime_s,x_m,y_m,z_m\n")
)
BACKUP: Final = MadeFile(
    "a backup by `drives backup`", re.compile(rb'\A\s*\{\s*"format":(?s:.*)"cell":(?s:.*)"drives":')
)
LOAD_DATA: Final = MadeFile("load data by `payload export`", re.compile(rb"written by rid-daq"))
EXPORT: Final = MadeFile(
    "an export",
    re.compile(
        rb'written by rid-daq \d|\A\s*\{\s*"kind":\s*"rid-daq parameters"'
        rb"|\AMATLAB 5.0 MAT-file, rid-daq"
        rb"|\APAR1(?s:.*)rid-daq|\AMDF (?s:.*)rid-daq|\Atime_s,|\Akind,name,words,value,unit,"
    ),
)
