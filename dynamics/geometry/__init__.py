"""Where the links are: forward and inverse kinematics, distances between bodies.

No masses and no torques. Begin with `kinematics.py`.
"""
