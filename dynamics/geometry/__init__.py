"""Geometry of the links: forward and inverse kinematics, distances between bodies.

It contains no masses and no torques. Begin with `kinematics.py`.
"""
