"""The robot file: kinematics, joints, limits, bodies; and how a URDF becomes one.

What is known before anything is measured; models of it stand in `dynamics`. Begin with `robot.py`.
"""
