"""Calibration of what a robot model alone cannot determine: torque constants and force plate.

The torque constants need a weighed load or a force plate. For a plate, description, delay and clock
are estimated. To understand the package, read `drive_gains.py` first.
"""
