"""Scales that a model cannot tell from its parameters: torque constants, the plate's load.

What needs a load that was weighed, or a plate. Begin with `drive_gains.py`.
"""
