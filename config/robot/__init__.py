"""Robot file: kinematics, joints, limits, bodies; and conversion of a URDF to a robot file.

It describes what is known before a measurement; models are in `dynamics`. Begin with `robot.py`.
"""
