"""Runs as operations read them: `RunData.load`, and the data that a motion's run adds.

Every reader of a run uses this room, so that the run's files are compared with its manifest. Begin
with `run_data.py`.
"""
