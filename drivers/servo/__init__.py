"""CiA 402 drives on CANopen: bring-up, cyclic exchange, monitoring, stops, units.

The package handles single drives, and all axes of a robot on one bus; it plans no motion. Begin
with `axes.py`; then read `requirements.py` and `stop_ramp.py` for the values that a drive needs
before motion.
"""
