"""Geometry of the links: forward and inverse kinematics, distances between bodies.

The package contains no masses and no torques. Begin with `kinematics.py`.
"""
