"""Move a cell and record it: `RunSession` makes the runs of all commands that move a cell.

Motions, rehearsals, payload sessions, plate zero and streams use it. Code that works on files only
is in `runs`. Begin with `run_session.py`.
"""
