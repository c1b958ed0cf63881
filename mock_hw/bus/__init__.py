"""The simulated CAN bus: a hub with arbitration, transmission times and faults, and its clients.

The package contains frames and time only. Begin with `hub.py`; decision 0003 gives the reasons.
"""
