"""A simulated CiA 402 drive: objects, states, ramps, watches, faults.

A function of frames and time: no bus and no clock of its own. Begin with `drive.py`.
"""
