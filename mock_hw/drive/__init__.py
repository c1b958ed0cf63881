"""A simulated CiA 402 drive: objects, states, ramps, timeouts, faults.

The drive is a function of frames and time; it has no bus and no clock. Begin with `drive.py`.
"""
