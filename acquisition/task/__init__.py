"""The cyclic task: the loop that moves the robot, and all that decides whether it may.

No log and no file in the cycle's path. Begin with `cyclic_task.py`, then `supervisor.py` and
`stop_sequence.py`.
"""
