"""`RobotModel`: all terms of a robot, and computations with them.

The functions take an immutable model; nothing is estimated here. Begin with `robot_model.py`.
"""
