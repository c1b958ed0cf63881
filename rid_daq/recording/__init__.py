"""Move a cell and record it: every recording of the program goes through `RunSession`.

Motions, rehearsals, payload sessions, plate zero and streams use it. Code that works on files only
is in `runs`. Begin with `run_session.py`.
"""
