"""Supervision of each cycle: decides if the motion may continue, and gives the reason for a stop.

Nothing here reads a clock or accesses a device. Begin with `supervisor.py`; `acquisition/task`
carries out a stop.
"""
