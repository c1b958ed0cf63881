"""The simulated CAN bus: a hub with arbitration, wire time and faults, and who joins it.

Frames and time only. Begin with `hub.py`; decision 0003 says why.
"""
