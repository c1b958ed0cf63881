"""CiA 402 drives on CANopen: bring-up, cyclic exchange, monitoring, stops, units.

It handles one drive, or all axes of a robot on one bus; no motion is planned here. Begin with
`axes.py`, then `requirements.py` and `stop_ramp.py`: the values that a drive needs before motion.
"""
