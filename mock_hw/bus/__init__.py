"""The simulated CAN bus: a hub with arbitration, transmission times and faults; its clients.

The package transmits frames and does not interpret them. Begin with `hub.py`; decision 0003 gives
the reasons for the design.
"""
