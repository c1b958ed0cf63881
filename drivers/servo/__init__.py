"""CiA 402 drives on CANopen: bring-up, cyclic exchange, watches, stops, units.

One drive, or all axes of a robot, on one bus; no motion is planned here. Begin with `axes.py`, then
`requirements.py` and `stop_ramp.py`: what a drive must hold before it moves.
"""
