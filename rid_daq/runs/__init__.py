"""Runs as the program's jobs read them: `read_run`, and what a motion's run adds.

Every reader of a run goes through here, so that it is compared. Begin with `run_data.py`.
"""
