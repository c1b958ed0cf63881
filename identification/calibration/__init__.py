"""Calibration of scales that a robot model alone cannot determine: torque constants and plate.

The calibrations need a weighed load or a force plate. Start with `drive_gains.py`.
"""
