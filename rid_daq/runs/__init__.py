"""Runs as the program's jobs read them: `RunData.load`, and what a motion's run adds.

Every reader of a run goes through here, so that it is compared. Begin with `run_data.py`.
"""
