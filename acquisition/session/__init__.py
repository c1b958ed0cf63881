"""Processes of one recording: cyclic task, recorders, drive monitor and force plate.

The files start, watch and end the processes; the work of a cycle is in `acquisition/task`. Begin
with `record.py`.
"""
