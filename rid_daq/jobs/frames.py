"""`frames_recorded`: every frame on the bus beside a run, where that was asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from acquisition.runs.folder import RunFolder
from acquisition.session.frame_recorder import FrameRecorder
from config.cell.cell import CanBusConfig
from config.errors import RecordingError, TransportError
from rid_daq.terminal.console import Console

FRAMES = "frames.blf"


@contextlib.contextmanager
def frames_recorded(
    bus: CanBusConfig, folder: RunFolder, wanted: bool, console: Console
) -> Iterator[None]:
    """Record the bus's frames into a run for as long as the `with` lasts.

    What goes wrong with them on the way is told and costs nothing else.

    Raises
    ------
    ConfigError, TransportError, RecordingError
        They cannot be recorded from the start.
    """
    if not wanted:
        yield
        return
    with FrameRecorder(bus, folder.file(FRAMES)) as recorder:
        yield
        try:
            console.say(f"{FRAMES}: {recorder.finish()} frames")
        except (RecordingError, TransportError) as error:
            console.say(f"note: {FRAMES} is not whole: {error}")
