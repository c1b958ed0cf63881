"""Decision in every cycle whether the motion may continue, and the reason of a stop.

Nothing here reads a clock or accesses a device. Begin with `supervisor.py`; `acquisition/task`
carries out a stop.
"""
