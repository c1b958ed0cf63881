"""The commands that are no operations yet: a line goes when its command becomes one."""

from __future__ import annotations

from typing import Final

from rid_daq.operations.catalogue import Entry

TYPER: Final = {
    "axes": Entry(
        "axes", "Cell", "test direction, encoder and gear of every axis, before the first motion"
    ),
    "jog": Entry(
        "jog", "Cell", "move one joint at a time, or go to the home pose, while a key is held"
    ),
    "plate zero": Entry("plate", "", "the plate's offsets: read, turn axis 1 by half a turn, read"),
    "record": Entry("record", "Experiment", "run a motion on a cell and record it"),
    "identify": Entry(
        "identify", "Identify", "estimate the robot's parameters from one or more runs"
    ),
    "payload session": Entry(
        "payload_session", "", "lead through a session: check, warm up, record, identify, judge"
    ),
    "sensitivity": Entry(
        "sensitivity", "Payload", "what wrong knowledge of the robot does to a payload's estimate"
    ),
    "stream": Entry(
        "stream", "Path", "follow a path more closely, live: from a file or from another program"
    ),
}
"""Every such command by its words: its module in `rid_daq.commands`, section and summary."""
