"""The commands that are no operations yet: a line goes when its command becomes one."""

from __future__ import annotations

from typing import Final

from rid_daq.operations.catalogue import Entry

TYPER: Final = {
    "demo": Entry(
        "demo",
        "Begin",
        "the whole story on the bundled simulated cell, with a report, no hardware",
    ),
    "init": Entry("init", "Begin", "write a commented cell, robot and motion to start from"),
    "docs": Entry("docs", "Begin", "the documentation, in the browser: guides, reference, theory"),
    "axes": Entry(
        "axes", "Cell", "test direction, encoder and gear of every axis, before the first motion"
    ),
    "jog": Entry(
        "jog", "Cell", "move one joint at a time, or go to the home pose, while a key is held"
    ),
    "drives backup": Entry("drives", "", "every setting of a cell's drives into a file"),
    "drives restore": Entry("drives", "", "the drives hold what a backup says"),
    "drives rollback": Entry("drives", "", "what a run wrote to the drives, undone"),
    "drives fit": Entry("drives", "", "the keys that a drive's data sheet needs"),
    "mock": Entry("mock", "Cell", "serve a cell's simulated devices on their bus until stopped"),
    "plate zero": Entry("plate", "", "the plate's offsets: read, turn axis 1 by half a turn, read"),
    "stop": Entry("stop", "Cell", "quick stop of whatever session is running on this machine"),
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
    "runs": Entry("runs", "Runs", "list the runs, and check that their files are unchanged"),
    "serve": Entry(
        "serve", "Service", "cells as a service: jobs, runs and a workbench in the browser"
    ),
    "token": Entry(
        "token", "Service", "let a program or a device in to a service of this computer"
    ),
}
"""Every such command by its words: its module in `rid_daq.commands`, section and summary."""

WITHOUT_NUMERICS: Final = frozenset({"docs", "init", "runs", "stop", "token"})
