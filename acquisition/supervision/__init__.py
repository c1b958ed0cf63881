"""What decides, every cycle, whether the motion may go on, and why it stopped.

Nothing here reads a clock or touches a device. Begin with `supervisor.py`; what is done about a
stop stands in `acquisition/task`.
"""
