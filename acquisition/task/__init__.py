"""The cyclic task: the loop that moves the robot, and its way to rest.

No log and no file in the cycle's path. Begin with `cyclic_task.py`, then `stop_sequence.py`; what
decides whether the motion may go on stands in `acquisition/supervision`.
"""
